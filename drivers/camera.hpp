// The one interface of every camera: v4l2, aravis, libcamera and replay stand behind it.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "drivers/device.hpp"
#include "drivers/frame.hpp"

namespace previz {

// Nothing arrived within the time-out; the device may still be well.
struct NoFrame {};

using CameraEvent = std::variant<FramePtr, NoFrame, EndOfStream, DeviceTrouble>;

class Camera {
 public:
  virtual ~Camera() = default;

  // The stable name a set file uses for this device.
  virtual std::string name() const = 0;

  // Waits at most `timeout` for the next frame, in capture order.
  virtual CameraEvent next(std::chrono::milliseconds timeout) = 0;

  // Asks for an exposure (shutter seconds, linear gain) from some later frame on. Returns false
  // where the device cannot be driven; the exposure that applied is on each frame.
  virtual bool set_exposure(double exposure_s, double gain) = 0;
};

}  // namespace previz
