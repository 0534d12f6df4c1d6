// Compares lamps with the film camera's white: files of others have their lamps in other units.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::scene {

// An exposure is the film camera's: a radiance of 1 / exposure is white. Where it is not known, 1
// is used, which the words then say.

// Returns how strong the scene's light with this index is, in the unit in which it is given, and
// how bright a white sheet that faces it would be: of radiance I / (pi d^2) at the distance d = 1 m
// of a lamp of intensity I, E / pi by a directional light of irradiance E. Gains and tint of a
// [[light]] do not count, lamp_gain does:
//   "5435 cd in its file: a white sheet at 1 m is 1730 times white"
std::string strength_words(const Scene& scene, std::size_t light,
                           const std::optional<double>& exposure);

// Returns a line for each object with a lamp that makes such a sheet more than 30 times white, with
// a lamp_gain that mends it. The sheet is where the nearest thing that is more than 1 m away is; of
// things in front of which a lamp may stand, the box around each counts.
std::vector<std::string> remarks_on_bright_lamps(const Scene& scene, const set::Set& set,
                                                 const std::optional<double>& exposure);

}  // namespace previz::scene
