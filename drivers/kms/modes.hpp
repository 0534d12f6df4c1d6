// Lists the modes of a screen, and chooses the one that is meant.
#pragma once

#include <xf86drmMode.h>

#include <optional>
#include <span>
#include <string>

#include "drivers/display.hpp"

namespace previz::kms {

// Takes the rate from the pixel clock, since the kernel's own is rounded to whole Hz.
DisplayMode mode_of(const drmModeModeInfo& info);

// Returns the mode of the wanted size with the rate nearest to the wanted one within half a Hz, or
// with the highest rate if none is given; progressive before interlaced. Without a wish it returns
// what the screen prefers. Throws previz::Error that lists the modes.
const drmModeModeInfo& choose_mode(std::span<const drmModeModeInfo> modes,
                                   const std::optional<DisplayMode>& wanted);

// Returns "1920x1080@60, 1280x720@50", with each mode once.
std::string list_of(std::span<const drmModeModeInfo> modes);

}  // namespace previz::kms
