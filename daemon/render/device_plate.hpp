// The camera's picture on a device. It goes up as the camera gave it, and the device makes the
// plate's codes of it. Internal to the render room.
#pragma once

#include <cstdint>
#include <span>

#include "daemon/render/kernel.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::render {

class DevicePlate {
 public:
  explicit DevicePlate(Device& device);
  static std::span<const Pass> passes();  // of its kernels

  // Uploads the bytes of the frame, and records what makes codes of them: those of to_plate(), bit
  // for bit. Throws as check_size().
  void take(const Frame& frame);
  // Uploads codes as they are.
  void take(const Plate& plate);

  // Returns the codes of the whole picture as shaders/lib/plate.glsl reads them.
  const Buffer& codes() const { return codes_; }

 private:
  void reserve(std::size_t samples);

  Device& device_;
  Kernel kernel_;
  Buffer bytes_, codes_, yuv_terms_;
};

// Return whether a sample of the picture may be `least` or more. That of a frame of Y'CbCr is a
// bound, which says yes where the picture has none, if its largest luma and chroma would make one.
bool has_at_least(const Frame& frame, std::uint32_t least);
bool has_at_least(const Plate& plate, std::uint32_t least);

}  // namespace previz::render
