// Makes a shown picture into a frame of a take's stream "composite".
#pragma once

#include <cstdint>

#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::output {

// Returns `picture` at width x height, which must be at least its own size. A preview's pixels are
// repeated, so that the stream keeps one size. `timestamp_ns` is the time of the camera frame from
// which the picture was made.
Frame shown_frame(const Plate& picture, int width, int height, std::uint64_t sequence,
                  std::int64_t timestamp_ns);

}  // namespace previz::output
