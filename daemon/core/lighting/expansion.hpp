// Applies inverse tone mapping to pixels that are clipped in every exposure of a bracket (P5).
#pragma once

#include "daemon/core/lighting/hdr.hpp"

namespace previz::lighting {

// Over-exposed pixels hold the white at which they are clipped; this multiplies them by up to
// `gain` (>= 1): radiance *= 1 + (gain - 1) * b, where b is the share of over-exposed pixels
// around, weighted by a 5x5 binomial filter. All channels get the same factor, so the recorded
// colour stays; a pixel that clips by chance hardly changes, lamps of a few pixels do; and nothing
// exceeds gain * white. After Rempel et al. 2007, "Ldr2Hdr: On-the-Fly Reverse Tone Mapping of
// Legacy Video and Photographs", section 3.2, whose mask is wider because it serves a display that
// people look at.
void expand_clipped(HdrPicture& picture, double gain);

}  // namespace previz::lighting
