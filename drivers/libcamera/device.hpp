// A camera of libcamera. What libcamera changes from version to version is in device.cpp alone,
// which is written for 0.0.3 (Debian 12). Not for use outside the driver.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/convert/convert.hpp"
#include "drivers/exposure_ledger.hpp"

namespace previz::libcam {

struct Listed {
  std::string id;     // stable: where the camera is connected, and what it is
  std::string model;  // empty where libcamera does not know
};
std::vector<Listed> list_cameras();

// Vendor and product of a UVC camera, in which its id ends; none of any other camera.
struct UvcProduct {
  std::uint16_t vendor = 0, product = 0;
};
std::optional<UvcProduct> uvc_product(const std::string& id);

// What a camera and we have settled on.
struct Agreed {
  CameraFormat format;
  convert::WireFormat wire;
  std::size_t stride = 0;  // bytes
  bool drives_exposure = false, drives_gain = false;
};

// A request that came back. Its bytes are valid until the buffer is queued again.
struct Completed {
  enum class Fate { whole, damaged, given_up };
  std::size_t buffer = 0;
  Fate fate = Fate::given_up;
  std::uint32_t sequence = 0;        // the kernel's
  std::int64_t timestamp_ns = 0;     // CLOCK_MONOTONIC; 0 where there is none
  std::optional<double> exposure_s;  // as the camera says; UVC cameras do not
  double gain = 1;                   // with exposure_s only
  bool overfull = false;             // says to hold more than the buffer can
  std::vector<std::span<const std::uint8_t>> planes;
};

class Device {
 public:
  // Throws previz::Error that names the device, the setting, and what the camera can.
  explicit Device(const CameraSettings& settings);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  const Agreed& agreed() const;
  bool streaming() const;
  bool unplugged() const;

  // Starts with every buffer queued. Throws previz::Error.
  void start(const std::optional<Exposure>& exposure);
  // All requests come back before it returns; none of them is told.
  void stop();

  // The next request that came back; none after the time-out, or when the device is gone.
  std::optional<Completed> wait(std::chrono::milliseconds timeout);

  // The exposure as the camera can take it.
  Exposure possible(const Exposure& wanted) const;
  // Queues a buffer again, with a new exposure for its frame and those after it where one is given.
  // False where the camera does not take it, which is its end.
  bool queue(std::size_t buffer, const std::optional<Exposure>& exposure);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::libcam
