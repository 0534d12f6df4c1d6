// The camera's picture on a device. It goes up as the camera gave it, and the device makes the
// plate's codes of it. Internal to the render room.
#pragma once

#include <cstdint>
#include <span>

#include "daemon/core/render/device/code_tables.hpp"
#include "daemon/core/render/device/kernel.hpp"
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
  // Does the same, and makes the plate smaller: every pixel has the mean of the linear signal over
  // its area. `tables` are of the response; neither side may be longer than the frame's.
  void take(const Frame& frame, int width, int height, const CodeTables& tables);
  // Uploads codes as they are.
  void take(const Plate& plate);

  // Returns the codes of the whole picture as shaders/lib/plate.glsl reads them.
  const Buffer& codes() const { return codes_; }
  // Returns likewise those of the picture that the last one was made of by making it smaller.
  const Buffer& whole() const { return whole_; }

 private:
  // A device may let its passes write less than it reads: `is_made_here` says that one does.
  void reserve(Buffer& codes, std::size_t pixels, bool is_made_here = false);
  void make_codes(const Frame& frame, Buffer& codes);
  template <typename Constants>
  void dispatch(Kernel& kernel, Constants constants, std::size_t pixels, const Buffers& buffers);

  Device& device_;
  Kernel codes_of_bytes_, scale_;
  Buffer bytes_, codes_, yuv_terms_;
  Buffer whole_;  // codes of a picture that is made smaller
};

// Return whether a sample of the picture may be `least` or more. That of a frame of Y'CbCr is a
// bound, which says yes where the picture has none, if the brightest luma and the strongest chroma
// of 64 pixels in a row would make one. The frame must be whole (check_size()).
bool has_at_least(const Frame& frame, std::uint32_t least);
bool has_at_least(const Plate& plate, std::uint32_t least);

}  // namespace previz::render
