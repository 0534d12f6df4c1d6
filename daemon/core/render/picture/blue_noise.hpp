// A pattern of thresholds by which a picture is dithered: its differences are of high frequencies
// only, which the eye sees least.
#pragma once

#include <cstdint>
#include <vector>

namespace previz::render {

// Returns side * side thresholds, (i + 1/2) / side^2 for i from 0 on, row-major; the pattern
// repeats in both directions. The same in every call. Source: Ulichney, "The void-and-cluster
// method for dither array generation", 1993. Takes a time of side^4.
std::vector<float> blue_noise(std::uint32_t side);

}  // namespace previz::render
