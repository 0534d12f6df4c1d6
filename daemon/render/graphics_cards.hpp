// The graphics cards of the computer as the kernel knows them, and what a card lacks on Debian 12
// that no Vulkan driver finds.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace previz::render {

// A card on the PCI bus of a maker whose cards Debian has drivers for.
struct GraphicsCard {
  std::uint32_t vendor;       // its PCI number, by which Vulkan's devices are known too
  std::string kernel_driver;  // "amdgpu"; empty: none has taken it
};

// `sys` is where sysfs is mounted. A file that cannot be read is none.
std::vector<GraphicsCard> graphics_cards(const std::filesystem::path& sys = "/sys");

// Returns what a card needs before Vulkan finds it: a sentence that names the package.
std::string driver_advice(const GraphicsCard& card);

// Returns one sentence for each kind of card of which Vulkan has found none: `found` are the
// vendors of the devices that it has found.
std::vector<std::string> drivers_missing(std::span<const GraphicsCard> cards,
                                         std::span<const std::uint32_t> found);

// Returns what keeps a card from showing pictures on a screen without a window system; empty if
// nothing does.
std::string screen_advice(const std::filesystem::path& sys = "/sys");

}  // namespace previz::render
