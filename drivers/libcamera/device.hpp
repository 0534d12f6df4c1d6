// Wraps a camera of libcamera. Whatever differs between versions of libcamera is in device.cpp
// alone, which is written for 0.0.3 (Debian 12). Not for use outside the driver.
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

// The vendor and product in which the id of a UVC camera ends; other cameras have none.
struct UvcProduct {
  std::uint16_t vendor = 0, product = 0;
};
std::optional<UvcProduct> uvc_product(const std::string& id);

// The settings that the camera and the driver have agreed on.
struct Agreed {
  CameraFormat format;
  convert::WireFormat wire;
  std::size_t stride = 0;  // bytes
  bool drives_exposure = false, drives_gain = false;
  std::vector<std::string> doubts;  // as Camera::doubts()
};

// A request that came back. Its bytes are valid until the buffer is queued again.
struct Completed {
  enum class Fate { whole, damaged, given_up };
  std::size_t buffer = 0;
  Fate fate = Fate::given_up;
  std::uint32_t sequence = 0;        // the kernel's
  std::int64_t timestamp_ns = 0;     // CLOCK_MONOTONIC or CLOCK_BOOTTIME; 0 where there is none
  std::optional<double> exposure_s;  // as the camera reports it; UVC cameras do not
  double gain = 1;                   // known only with exposure_s
  bool overfull = false;             // claims to hold more than the buffer can
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

  // Starts streaming with every buffer queued. Throws previz::Error.
  void start(const std::optional<Exposure>& exposure);
  // Stops streaming. All requests come back before it returns; wait() reports none of them.
  void stop();

  // Returns the next request that came back; none after the time-out, or if the device is gone.
  std::optional<Completed> wait(std::chrono::milliseconds timeout);

  // Returns the exposure nearest to `wanted` that the camera can take.
  Exposure possible(const Exposure& wanted) const;
  // Queues a buffer again, with a new exposure for its frame and those after it if one is given.
  // Returns false if the camera does not take the buffer, which is the end of the stream.
  bool queue(std::size_t buffer, const std::optional<Exposure>& exposure);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::libcam
