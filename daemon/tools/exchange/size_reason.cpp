#include "daemon/tools/exchange/size_reason.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

namespace previz::exchange {
namespace {

// Encoders round a scaled picture's sides to 8 pixels or so.
constexpr double same_shape = 0.01;

// Pixels' centres are whole numbers, so that a picture begins half a pixel before 0.
std::string scaled(char axis, double factor) {
  return fmt::format("f{0} * {1:.5g}, (c{0} + 0.5) * {1:.5g} - 0.5", axis, factor);
}

}  // namespace

std::string size_reason(int width, int height, int calibrated_width, int calibrated_height,
                        std::span<const std::string> known) {
  const double across = double(width) / calibrated_width, down = double(height) / calibrated_height;
  std::string reason;
  for (const std::string& what : known) reason += "; " + what;
  if (width == calibrated_height && height == calibrated_width)
    reason += "; the calibration is for the picture turned by a quarter";
  else if (std::abs(across / down - 1) < same_shape)
    reason += fmt::format(
        "; both have the same shape: if both show all of the sensor, intrinsics for {}x{} fit with "
        "{}, {}",
        width, height, scaled('x', across), scaled('y', down));
  else if (!known.empty() && (width == calibrated_width || height == calibrated_height))
    reason += fmt::format("; intrinsics for {}x{} fit with {}", width, height,
                          height == calibrated_height ? scaled('x', across) : scaled('y', down));
  else if (known.empty())
    reason +=
        "; their shapes differ, as where a camera's mode crops its sensor: calibrate with pictures "
        "of this size";
  return reason;
}

}  // namespace previz::exchange
