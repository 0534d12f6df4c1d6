#include "daemon/core/render/frame_input.hpp"

#include <string>

#include "drivers/error.hpp"

namespace previz::render {
namespace {

struct PlateSize {
  int width = 0, height = 0, bits = 8;  // without a plate: no pixel
};

PlateSize size_of(const FrameInput& input) {
  if (input.camera)
    return {input.camera->width, input.camera->height, plate_bits(input.camera->format)};
  if (input.plate && !input.plate->samples.empty())
    return {input.plate->width, input.plate->height, input.plate->bits};
  return {};
}

}  // namespace

int refuse_other_size(const FrameInput& input, const PinholeIntrinsics& lens) {
  const PlateSize taken = size_of(input);
  const bool fits = input.is_scaled ? taken.width >= lens.width && taken.height >= lens.height
                                    : taken.width == lens.width && taken.height == lens.height;
  if (taken.width > 0 && !fits)
    throw Error("observer: a frame of " + std::to_string(taken.width) + "x" +
                std::to_string(taken.height) + " does not fit the calibration's " +
                std::to_string(lens.width) + "x" + std::to_string(lens.height));
  return taken.bits;
}

}  // namespace previz::render
