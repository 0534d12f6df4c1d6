#include "daemon/render/graphics_cards.hpp"

#include <algorithm>
#include <fstream>
#include <optional>

namespace previz::render {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t amd = 0x1002, nvidia = 0x10de, intel = 0x8086;
constexpr std::uint32_t class_display =
    0x03;  // the highest byte of three (PCI Code and ID Assignment)

std::string first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

// Returns the number that a file holds as the kernel writes it ("0x10de").
std::optional<std::uint32_t> number_in(const fs::path& file) {
  try {
    return static_cast<std::uint32_t>(std::stoul(first_line(file), nullptr, 16));
  } catch (const std::logic_error&) {
    return std::nullopt;
  }
}

std::string of_nvidia(const std::string& kernel_driver) {
  if (kernel_driver == "nvidia")
    return "an NVIDIA card is there, but not its Vulkan driver: apt-get install nvidia-vulkan-icd";
  return "an NVIDIA card is there, but " +
         (kernel_driver.empty() ? std::string("no driver has taken it")
                                : "it is driven by " + kernel_driver) +
         ": add non-free to the package sources, apt-get install nvidia-driver, and start the "
         "computer again";
}

std::string of_amd(const std::string& kernel_driver) {
  if (kernel_driver == "amdgpu")
    return "an AMD card is there, but Vulkan does not find it: apt-get install "
           "mesa-vulkan-drivers, and let the user open it (adduser NAME render)";
  return "an AMD card is there, but not driven by amdgpu: add non-free-firmware to the package "
         "sources, apt-get install firmware-amd-graphics mesa-vulkan-drivers, and start the "
         "computer again";
}

std::string of_intel(const std::string& kernel_driver) {
  if (!kernel_driver.empty())
    return "an Intel card is there, but Vulkan does not find it: apt-get install "
           "mesa-vulkan-drivers, and let the user open it (adduser NAME render)";
  return "an Intel card is there that this kernel does not know: apt-get -t bookworm-backports "
         "install linux-image-amd64 mesa-vulkan-drivers, and start the computer again";
}

}  // namespace

std::vector<GraphicsCard> graphics_cards(const fs::path& sys) {
  std::vector<GraphicsCard> cards;
  std::error_code unreadable;
  for (fs::directory_iterator device(sys / "bus/pci/devices", unreadable), end;
       !unreadable && device != end; device.increment(unreadable)) {
    const auto kind = number_in(device->path() / "class");
    const auto vendor = number_in(device->path() / "vendor");
    if (!kind || !vendor || *kind >> 16 != class_display) continue;
    if (*vendor != amd && *vendor != nvidia && *vendor != intel) continue;
    std::error_code none;
    cards.push_back({*vendor, fs::read_symlink(device->path() / "driver", none).filename()});
  }
  return cards;
}

std::string driver_advice(const GraphicsCard& card) {
  return card.vendor == nvidia ? of_nvidia(card.kernel_driver)
         : card.vendor == amd  ? of_amd(card.kernel_driver)
                               : of_intel(card.kernel_driver);
}

std::vector<std::string> drivers_missing(std::span<const GraphicsCard> cards,
                                         std::span<const std::uint32_t> found) {
  std::vector<std::string> missing;
  for (const GraphicsCard& card : cards) {
    if (std::ranges::find(found, card.vendor) != found.end()) continue;
    std::string advice = driver_advice(card);
    if (std::ranges::find(missing, advice) == missing.end()) missing.push_back(std::move(advice));
  }
  return missing;
}

std::string screen_advice(const fs::path& sys) {
  if (first_line(sys / "module/nvidia_drm/parameters/modeset") != "N") return {};
  return "the NVIDIA card shows nothing without a window system: put nvidia-drm.modeset=1 on the "
         "kernel's command line (GRUB_CMDLINE_LINUX in /etc/default/grub, then update-grub), and "
         "start the computer again";
}

}  // namespace previz::render
