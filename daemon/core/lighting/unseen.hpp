// Fills the part of the map that the light camera cannot see.
#pragma once

#include <string>
#include <vector>

#include "daemon/core/lighting/hdr.hpp"
#include "daemon/core/lighting/resampling.hpp"
#include "daemon/core/lighting/viewpoint.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration/fisheye.hpp"

namespace previz::lighting {

// Adds to every texel of `map` that is not wholly seen the radiance of its unseen part, by
// settings.unseen:
//   constant  settings.unseen_radiance.
//   horizon   the edge of the seen region, continued. The outermost 10 degrees of the picture are
//             averaged by solid angle in 72 sectors of 5 degrees around the optical axis; pixels
//             brighter than 8 times the median luminance of that band are left out, so that a lamp
//             at the edge is not smeared below it. With E(psi) these averages, linear between the
//             sectors' centres, and t = 0 at the edge to 1 opposite to the optical axis:
//             radiance = mix(E(psi), mean of E, 3 t^2 - 2 t^3). Where a room hides its surface from
//             the camera: mean of E.
//   mirror    `elsewhere`, the picture mirrored about the plane through the camera that is
//             perpendicular to its optical axis; where that is unseen too, as horizon.
//   observer  `elsewhere`, what the film camera saw there; where it saw nothing, as horizon.
// `elsewhere` has the map's size or one that divides it; the first two rules ignore it. Remarks
// for the reader of the report are appended to `notes`.
void fill_unseen(const HdrPicture& picture, const Fisheye& lens, const Viewpoint& viewpoint,
                 const set::Lighting& settings, const Resampled* elsewhere, Resampled& map,
                 std::vector<std::string>& notes);

}  // namespace previz::lighting
