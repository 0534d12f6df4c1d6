// The one interface of every camera: v4l2, aravis, libcamera and replay stand behind it.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <variant>

#include "drivers/device.hpp"
#include "drivers/frame.hpp"

namespace previz {

// Nothing arrived within the time-out; the device may still be well.
struct NoFrame {};

using CameraEvent = std::variant<FramePtr, NoFrame, EndOfStream, DeviceTrouble>;

// What the pictures of an open camera are. Fixed until it is closed.
struct CameraFormat {
  PixelFormat format = PixelFormat::rgb8;
  int width = 0, height = 0;  // pixels
  double rate_hz = 0;         // nominal; 0 where the camera has none (triggered, or not told)
  BayerPattern bayer = BayerPattern::none;

  friend bool operator==(const CameraFormat&, const CameraFormat&) = default;
};

// A camera that is there now.
struct FoundCamera {
  std::string driver;       // as in the set file
  std::string device;       // its stable name
  std::string description;  // vendor, model, where it is plugged in
};

// An open camera; making it opens the device and settles its format, destroying it gives the device
// back whatever state it is in. Everything but the destructor may throw previz::Error only where it
// says so. One thread at a time.
//
// Frames come in capture order, each once, of format(); what a device sends that is no whole frame
// of that format is counted and never delivered. Sequence and timestamp_ns strictly increase, also
// from one streaming to the next. timestamp_ns and arrival_ns are CLOCK_MONOTONIC (of replay: the
// recorded session's clock).
class Camera {
 public:
  virtual ~Camera() = default;

  // The stable name a set file uses for this device.
  virtual std::string name() const = 0;

  virtual CameraFormat format() const = 0;

  // Frames captured from now on are delivered. Throws previz::Error if the device refuses. Does
  // nothing while the camera streams.
  virtual void start() = 0;

  // Ends streaming; what was captured and not yet taken is given up. May be called at any time.
  virtual void stop() = 0;

  // Waits at most `timeout` for the next frame. NoFrame while the camera does not stream. After
  // trouble that says `lost`, every later call says so again until the camera is closed.
  virtual CameraEvent next(std::chrono::milliseconds timeout) = 0;

  // Asks for an exposure (shutter seconds, linear gain), applied from some later frame on, within
  // what the device can. False where the device cannot be driven. What really applied is on each
  // frame; between two exposures frames may be left out whose exposure is not known.
  virtual bool set_exposure(double exposure_s, double gain) = 0;

  // Since the camera was opened.
  virtual DeviceCounters counters() const = 0;
};

}  // namespace previz
