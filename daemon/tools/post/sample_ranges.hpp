// Reads `--sample-range`, and says which frames can be divided so.
#pragma once

#include <string>

#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::post {

// Reads "2/4": the second of four ranges. Throws previz::Error saying what is allowed.
render::SampleRange parse_sample_range(const std::string& text);

// Throws previz::Error unless frames of this quality can be rendered in such ranges: every pixel
// gets quality.samples, frames are not averaged with their neighbours, and the range's count is a
// power of two and at most render::part_count().
void check_sample_range(render::SampleRange range, const set::Quality& quality);

}  // namespace previz::post
