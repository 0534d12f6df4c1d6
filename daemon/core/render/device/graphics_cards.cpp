#include "daemon/core/render/device/graphics_cards.hpp"

#include <algorithm>
#include <fstream>
#include <optional>

namespace previz::render {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t amd = 0x1002, nvidia = 0x10de, intel = 0x8086;
// The classes of PCI's "Code and ID Assignment Specification", without their lowest byte.
constexpr std::uint32_t display = 0x03, vga = 0x0300;

// Returns the number that a file holds as the kernel writes it ("0x10de").
std::optional<std::uint32_t> number_in(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  try {
    return static_cast<std::uint32_t>(std::stoul(line, nullptr, 16));
  } catch (const std::logic_error&) {
    return std::nullopt;
  }
}

// Connectors are folders such as drm/card0/card0-HDMI-A-1.
bool has_connectors(const fs::path& device) {
  std::error_code none;
  for (fs::recursive_directory_iterator entry(device / "drm", none), end; !none && entry != end;
       entry.increment(none)) {
    const std::string name = entry->path().filename();
    if (entry.depth() == 1 && name.starts_with("card") && name.find('-') != std::string::npos)
      return true;
    if (entry.depth() >= 1) entry.disable_recursion_pending();
  }
  return false;
}

std::string of_nvidia(const std::string& kernel_driver) {
  if (kernel_driver == "nvidia")
    return "graphics card NVIDIA: its Vulkan driver is missing; apt-get install nvidia-vulkan-icd";
  return "graphics card NVIDIA: " +
         (kernel_driver.empty() ? std::string("no driver is loaded for it")
                                : "it is driven by " + kernel_driver + ", without Vulkan") +
         "; apt-get install linux-headers-amd64 nvidia-driver (contrib, non-free and "
         "non-free-firmware in the package sources), then restart the computer";
}

std::string of_amd(const std::string& kernel_driver) {
  if (kernel_driver == "amdgpu")
    return "graphics card AMD: Vulkan cannot open it; adduser USER render and log in again, or "
           "apt-get install mesa-vulkan-drivers";
  if (kernel_driver == "radeon")
    return "graphics card AMD: it is driven by radeon, without Vulkan; add radeon.si_support=0 "
           "radeon.cik_support=0 amdgpu.si_support=1 amdgpu.cik_support=1 to the kernel's command "
           "line, then restart the computer";
  return "graphics card AMD: no driver is loaded for it; apt-get install firmware-amd-graphics "
         "(non-free-firmware in the package sources) mesa-vulkan-drivers, then restart the "
         "computer";
}

std::string of_intel(const std::string& kernel_driver) {
  if (!kernel_driver.empty())
    return "graphics card Intel: Vulkan cannot open it; adduser USER render and log in again, or "
           "apt-get install mesa-vulkan-drivers";
  return "graphics card Intel: this kernel does not drive it; apt-get install mesa-vulkan-drivers "
         "and, on Debian 13, firmware-intel-graphics (non-free-firmware in the package sources) "
         "or, on Debian 12, -t bookworm-backports linux-image-amd64 firmware-misc-nonfree "
         "(bookworm-backports too), then restart the computer";
}

std::string advice_for(const GraphicsCard& card) {
  return card.vendor == nvidia ? of_nvidia(card.kernel_driver)
         : card.vendor == amd  ? of_amd(card.kernel_driver)
                               : of_intel(card.kernel_driver);
}

}  // namespace

std::vector<GraphicsCard> graphics_cards(const fs::path& sys) {
  std::vector<GraphicsCard> cards;
  std::error_code unreadable;
  for (fs::directory_iterator device(sys / "bus/pci/devices", unreadable), end;
       !unreadable && device != end; device.increment(unreadable)) {
    const auto kind = number_in(device->path() / "class");
    const auto vendor = number_in(device->path() / "vendor");
    if (!kind || !vendor || *kind >> 16 != display) continue;
    if (*vendor != amd && *vendor != nvidia && *vendor != intel) continue;
    std::error_code none;
    cards.push_back({*vendor, fs::read_symlink(device->path() / "driver", none).filename(),
                     *kind >> 8 == vga, has_connectors(device->path())});
  }
  return cards;
}

// A card that a virtual machine has is not this computer's (vfio-pci).
std::vector<std::string> drivers_missing(std::span<const GraphicsCard> cards,
                                         std::span<const std::uint32_t> found) {
  std::vector<std::string> missing;
  for (const GraphicsCard& card : cards) {
    if (card.kernel_driver == "vfio-pci" || std::ranges::find(found, card.vendor) != found.end())
      continue;
    std::string advice = advice_for(card);
    if (std::ranges::find(missing, advice) == missing.end()) missing.push_back(std::move(advice));
  }
  return missing;
}

std::string screen_advice(std::span<const GraphicsCard> cards) {
  const bool is_blind = std::ranges::any_of(cards, [](const GraphicsCard& card) {
    return card.kernel_driver == "nvidia" && card.is_for_screens && !card.has_connectors;
  });
  if (!is_blind) return {};
  return "graphics card NVIDIA: it shows nothing without a window system; add "
         "nvidia-drm.modeset=1 to the kernel's command line (GRUB_CMDLINE_LINUX in "
         "/etc/default/grub, then update-grub), then restart the computer";
}

}  // namespace previz::render
