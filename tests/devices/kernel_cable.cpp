#include "tests/devices/kernel_cable.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <thread>
#include <utility>

#include "drivers/camera_drivers.hpp"
#include "drivers/error.hpp"

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

// Returns when udev has followed: a device that comes back while udev is still removing it is found
// and gone again a moment later.
void tell_kernel(const std::filesystem::path& file, const std::string& word) {
  std::ofstream(file) << word;
  if (std::system("udevadm settle --timeout=20") != 0)
    throw Error("udev does not follow " + file.string() + " within 20 s");
}

}  // namespace

KernelCable::KernelCable(std::string driver, std::string device)
    : driver_(std::move(driver)), device_(std::move(device)) {
  const auto place = camera_driver(driver_).usb_place(device_);
  if (const char* file = std::getenv("PREVIZ_TEST_USB_CABLE"); file && place) {
    file_ = file;
  } else if (place) {
    out_ = in_ = usb_device_at(*place) / "authorized";
    out_word_ = std::string(1, '0');
    in_word_ = std::string(1, '1');
  } else if (device_.find("vivid.0") != std::string::npos) {
    out_ = "/sys/bus/platform/drivers/vivid/unbind";
    in_ = "/sys/bus/platform/drivers/vivid/bind";
    out_word_ = in_word_ = "vivid.0";
  }
}

KernelCable::~KernelCable() {
  try {
    plug();
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
  }
}

std::string KernelCable::why_not() const {
  if (!file_.empty()) return "";
  if (out_.empty()) return device_ + " is neither a USB camera nor vivid";
  return access(out_.c_str(), W_OK) == 0 ? "" : out_.string() + " may not be written";
}

void KernelCable::unplug() {
  if (!std::exchange(plugged_, false)) return;
  if (file_.empty()) {
    tell_kernel(out_, out_word_);
  } else {
    remove(file_);
    wait_until_found(false);
  }
}

void KernelCable::plug() {
  if (std::exchange(plugged_, true)) return;
  if (file_.empty())
    tell_kernel(in_, in_word_);
  else
    std::ofstream(file_).close();
  wait_until_found(true);
}

void KernelCable::wait_until_found(bool found) const {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  const auto is_found = [this] {
    const std::vector<FoundCamera> all = camera_driver(driver_).find();
    return std::ranges::find(all, device_, &FoundCamera::device) != all.end();
  };
  while (is_found() != found) {
    if (std::chrono::steady_clock::now() > end)
      throw Error(device_ + (found ? " is not found" : " is still found") + " after 20 s");
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace previz::test
