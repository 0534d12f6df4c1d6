#include "tests/devices/kernel_cable.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <thread>
#include <utility>

#include "drivers/camera_drivers.hpp"

namespace previz::test {
namespace {

int number_in(const std::filesystem::path& file) {
  int number = -1;
  std::ifstream(file) >> number;
  return number;
}

std::filesystem::path usb_device_at(const usb::Place& place) {
  for (const auto& entry : std::filesystem::directory_iterator("/sys/bus/usb/devices"))
    if (number_in(entry.path() / "busnum") == place.bus &&
        number_in(entry.path() / "devnum") == place.address)
      return entry.path();
  return {};
}

}  // namespace

KernelCable::KernelCable(std::string driver, std::string device)
    : driver_(std::move(driver)), device_(std::move(device)) {
  if (const auto place = camera_driver(driver_).usb_place(device_)) {
    out_ = in_ = usb_device_at(*place) / "authorized";
    out_word_ = std::string(1, '0');
    in_word_ = std::string(1, '1');
  } else if (device_.find("vivid.0") != std::string::npos) {
    out_ = "/sys/bus/platform/drivers/vivid/unbind";
    in_ = "/sys/bus/platform/drivers/vivid/bind";
    out_word_ = in_word_ = "vivid.0";
  }
}

std::string KernelCable::why_not() const {
  if (out_.empty()) return device_ + " is neither a USB camera nor vivid";
  return access(out_.c_str(), W_OK) == 0 ? "" : out_.string() + " may not be written";
}

void KernelCable::unplug() {
  if (std::exchange(plugged_, false)) std::ofstream(out_) << out_word_;
}

void KernelCable::plug() {
  if (std::exchange(plugged_, true)) return;
  std::ofstream(in_) << in_word_;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  const auto there = [this] {
    const std::vector<FoundCamera> found = camera_driver(driver_).find();
    return std::ranges::find(found, device_, &FoundCamera::device) != found.end();
  };
  while (!there() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

}  // namespace previz::test
