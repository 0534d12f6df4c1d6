// Finds settings that are allowed one by one and that no stage has: other units, another picture's
// numbers.
#pragma once

#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"

namespace previz::set {

// Returns a line for each, with its key, what is odd about it, and what was probably meant:
//   tags      a side below 5 mm or above 0.5 m, or a place farther than 100 m
//   lenses    a field of view below 1 or above 150 degrees (the focal length is in pixels), focal
//             lengths across and down that differ by a fifth, a principal point in the picture's
//             outer quarters
//   [.lens]   a focal length, f-number or focus distance of no lens
//   cameras   a shutter time longer than a frame lasts
//   places    the light camera farther than 100 m
std::vector<std::string> implausible(const Set& set);

// Returns a line for each camera whose picture has another size than its intrinsics: a live set
// cannot run so.
std::vector<std::string> other_sizes(const Set& set);

}  // namespace previz::set
