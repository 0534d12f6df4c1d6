// Runs a function for every pixel, on all cores.
#pragma once

#include <cstddef>
#include <opencv2/core/utility.hpp>

namespace previz::render {

// Calls `body(i)` for every i < count, in no particular order and from several threads at once.
// `count` is at most 2^31 - 1.
void each_pixel(std::size_t count, const auto& body) {
  cv::parallel_for_(cv::Range(0, static_cast<int>(count)), [&](const cv::Range& part) {
    for (int i = part.start; i < part.end; ++i) body(static_cast<std::size_t>(i));
  });
}

}  // namespace previz::render
