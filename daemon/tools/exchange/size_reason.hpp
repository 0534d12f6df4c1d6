// Says why a picture does not have the size of its calibration, and what would fit.
#pragma once

#include <span>
#include <string>

namespace previz::exchange {

// `known`: what the footage says of its shape (Footage::shape()). Sizes are in pixels, above 0.
std::string size_reason(int width, int height, int calibrated_width, int calibrated_height,
                        std::span<const std::string> known);

}  // namespace previz::exchange
