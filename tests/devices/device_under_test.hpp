// What the compliance suite knows of a device: how to open it, and how to pull its cable.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <span>
#include <string>

#include "drivers/camera.hpp"

namespace previz::test {

class DeviceUnderTest {
 public:
  virtual ~DeviceUnderTest() = default;

  // Throws previz::Error while the device is unplugged.
  virtual std::unique_ptr<Camera> open() = 0;
  // Of a device that does not exist; must throw previz::Error that names it.
  virtual std::unique_ptr<Camera> open_missing() = 0;

  virtual void unplug() = 0;
  virtual void plug() = 0;
  // Why its cable cannot be pulled on this machine; empty where it can.
  virtual std::string why_no_cable() const { return {}; }
  // After which silence it may be taken to be unplugged; longer where it says so itself.
  virtual std::chrono::milliseconds stall_timeout() const { return std::chrono::milliseconds(150); }

  // Whether frames may be lost while somebody listens: on a bad network, under load.
  virtual bool may_lose_frames() const { return false; }

  // Makes every frame, or most of them, come damaged from now on, one after the other. Returns
  // false where this device cannot.
  virtual bool spoil() { return false; }

  // Two exposures the device can take exactly; none where it cannot be driven.
  struct Exposure {
    double exposure_s;
    double gain;
  };
  virtual std::span<const Exposure> exposures() const { return {}; }
  // Whether the picture shows that it was taken with the exposure the frame claims; nothing where
  // this device's pictures cannot say.
  virtual std::optional<bool> shows_its_exposure(const Frame&) const { return std::nullopt; }
  // Bytes that others' libraries may keep each time the device goes and comes.
  virtual std::size_t kept_by_others() const { return 0; }
};

// A driver under test; registry.cpp lists them.
struct RegisteredDevice {
  const char* name;
  bool live;         // its frames carry the host's time; those of a replayed take the take's
  bool has_a_cable;  // that can be pulled
  // Null where this machine has no such device; `why_not` then says what is missing.
  std::function<std::unique_ptr<DeviceUnderTest>(std::string& why_not)> make;
};

inline void PrintTo(const RegisteredDevice& device, std::ostream* out) {
  *out << device.name;
}

std::span<const RegisteredDevice> registered_devices();

}  // namespace previz::test
