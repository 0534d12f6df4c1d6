// Knows the graphics cards of the computer from the kernel, and what those need on Debian 12 and
// 13 for which there is no Vulkan driver.
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
  std::string kernel_driver;  // "amdgpu"; empty: none drives it
  bool is_for_screens;        // and not for computing alone
  bool has_connectors;        // the kernel can show pictures on it
};

// `sys` is where sysfs is mounted. What cannot be read there counts as absent.
std::vector<GraphicsCard> graphics_cards(const std::filesystem::path& sys = "/sys");

// Returns what each kind of card needs that Vulkan does not have, a sentence a kind that names it
// and the packages. `found` are the vendors of the devices that Vulkan has.
std::vector<std::string> drivers_missing(std::span<const GraphicsCard> cards,
                                         std::span<const std::uint32_t> found);

// Returns what keeps a card from showing pictures on a screen without a window system; empty if
// nothing does.
std::string screen_advice(std::span<const GraphicsCard> cards);

}  // namespace previz::render
