// The one interface of every camera: v4l2, aravis, libcamera and replay stand behind it.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "drivers/device.hpp"
#include "drivers/frame.hpp"

namespace previz {

// Nothing arrived within the time-out; the device may still be well.
struct NoFrame {};

using CameraEvent = std::variant<FramePtr, NoFrame, EndOfStream, DeviceTrouble>;

// The format of an open camera's pictures, which is fixed until the camera is closed.
struct CameraFormat {
  PixelFormat format = PixelFormat::rgb8;
  int width = 0, height = 0;  // pixels
  double rate_hz = 0;         // nominal; 0 if the camera is triggered or reports none
  BayerPattern bayer = BayerPattern::none;

  friend bool operator==(const CameraFormat&, const CameraFormat&) = default;
};

// A camera that is there now.
struct FoundCamera {
  std::string driver;        // as in the set file
  std::string device;        // its stable name
  std::string description;   // vendor, model, where it is plugged in
  std::string trouble = {};  // not empty: no camera, but why the driver could not look everywhere
};

// An open camera. Making it opens the device and settles its format; destroying it gives the device
// back, whatever its state. A function throws previz::Error only if its comment says so. Only one
// thread may use the camera at a time.
//
// Frames come in capture order, each once, of format(); anything else that a device sends is
// counted and never delivered. Sequence and timestamp_ns strictly increase, also from one streaming
// to the next. timestamp_ns and arrival_ns are CLOCK_MONOTONIC (for replay: the recorded session's
// clock).
class Camera {
 public:
  virtual ~Camera() = default;

  // The stable name a set file uses for this device.
  virtual std::string name() const = 0;

  virtual CameraFormat format() const = 0;

  // What the device does not do as it was asked, in plain words, with what it can: a lower rate.
  virtual std::vector<std::string> doubts() const { return {}; }

  // Starts streaming: frames captured from now on are delivered. Throws previz::Error if the device
  // refuses. Does nothing while the camera streams.
  virtual void start() = 0;

  // Ends streaming and drops the frames that were captured but not yet taken. May be called at any
  // time.
  virtual void stop() = 0;

  // Waits at most `timeout` for the next frame. Returns NoFrame while the camera does not stream.
  // After trouble with `lost`, every later call reports it again until the camera is closed.
  virtual CameraEvent next(std::chrono::milliseconds timeout) = 0;

  // Asks for an exposure (shutter seconds, linear gain), which applies from some later frame on,
  // within what the device can do. Returns false if the device's exposure cannot be driven. Each
  // frame carries the exposure that really applied; frames between two exposures may be left out if
  // theirs is not known.
  virtual bool set_exposure(double exposure_s, double gain) = 0;

  // Counts since the camera was opened.
  virtual DeviceCounters counters() const = 0;
};

}  // namespace previz
