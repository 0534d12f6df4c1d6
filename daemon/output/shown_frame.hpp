// What a display shows, as a frame of a take: the stream "composite".
#pragma once

#include <cstdint>

#include "drivers/frame.hpp"

namespace previz::output {

// `picture` at width x height, at least its own size: a preview's pixels are repeated, so that the
// stream keeps one size whatever the preview's. `timestamp_ns` is the camera frame's it was made
// of.
Frame shown_frame(const Plate& picture, int width, int height, std::uint64_t sequence,
                  std::int64_t timestamp_ns);

}  // namespace previz::output
