// Inverse tone mapping of what no exposure of a bracket is short enough for (P5).
#pragma once

#include "daemon/lighting/hdr.hpp"

namespace previz::lighting {

// Over-exposed pixels hold the white that they are clipped at; here they become up to `gain` (>= 1)
// times that: radiance *= 1 + (gain - 1) * b, b the share of over-exposed pixels around, weighted
// by a 5x5 binomial filter. All channels alike, so the colour that was recorded stays; a pixel that
// clips by chance hardly changes, lamps of a few pixels do; and nothing exceeds gain * white.
// After Rempel et al. 2007, "Ldr2Hdr: On-the-Fly Reverse Tone Mapping of Legacy Video and
// Photographs", section 3.2, whose mask is as wide because a display shows it to people.
void expand_clipped(HdrPicture& picture, double gain);

}  // namespace previz::lighting
