// Modes of a screen: what it offers, and which one is meant.
#pragma once

#include <xf86drmMode.h>

#include <optional>
#include <span>
#include <string>

#include "drivers/display.hpp"

namespace previz::kms {

// The rate from the pixel clock: the kernel's own is rounded to whole Hz.
DisplayMode mode_of(const drmModeModeInfo& info);

// What was asked for: of that size, and of the rate nearest to it within half a Hz, or the highest
// where none was given; progressive before interlaced. Nothing asked for: what the screen prefers.
// Throws previz::Error listing what there is.
const drmModeModeInfo& choose_mode(std::span<const drmModeModeInfo> modes,
                                   const std::optional<DisplayMode>& wanted);

// "1920x1080@60, 1280x720@50": each once.
std::string list_of(std::span<const drmModeModeInfo> modes);

}  // namespace previz::kms
