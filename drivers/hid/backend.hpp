// Loads hidapi's two back ends: hidraw, which goes through the kernel's own driver, and libusb,
// which goes past it.
#pragma once

#include <hidapi.h>

#include <memory>
#include <mutex>
#include <span>

namespace previz::hid {

struct Backend {
  const char* name;  // "hidraw", "libusb"
  decltype(&hid_open) open;
  decltype(&hid_close) close;
  decltype(&hid_read_timeout) read_timeout;
  decltype(&hid_enumerate) enumerate;
  decltype(&hid_free_enumeration) free_enumeration;
};

// Returns the back ends that this machine has, hidraw first: libusb takes a device away from the
// kernel, and is for machines on which hidraw may not be opened. Throws previz::Error if there is
// none.
std::span<const Backend> backends();

// Must be held while devices are looked for or opened, since hidapi keeps the text of its last
// error in one unguarded place.
std::mutex& library_mutex();

// An open device.
class Device {
 public:
  Device() = default;
  Device(const Backend& backend, hid_device* device)
      : device_(device, {backend.close}), backend_(&backend) {}

  explicit operator bool() const { return device_ != nullptr; }
  const char* backend() const { return backend_->name; }
  // Returns the number of bytes read; 0 after the time-out, negative if the device is gone.
  int read(std::span<unsigned char> report, int timeout_ms) const {
    return backend_->read_timeout(device_.get(), report.data(), report.size(), timeout_ms);
  }

 private:
  struct Close {
    decltype(&hid_close) close;
    void operator()(hid_device* device) const { close(device); }
  };
  std::unique_ptr<hid_device, Close> device_{nullptr, Close{nullptr}};
  const Backend* backend_ = nullptr;
};

}  // namespace previz::hid
