// Says which lamps of a set the light around it shows too, and how bright they are by that light.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/core/lighting/claims.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

struct LampClaims {
  // Those of set.captured_lamps come first, then those of real lamps and of what glows.
  std::vector<lighting::Claim> claims;
  std::vector<std::size_t> lights;    // for claims past the captured lamps: index into set.lights
  std::vector<std::string> troubles;  // what glows and is not claimed, in plain words
};
inline constexpr std::size_t no_light = ~std::size_t{0};  // in `lights`: it is an object's light

// Returns what the set's captured lamps, its real lamps and its real objects' lamps and glowing
// surfaces cover as seen from a place (world, metres). Real objects are phantoms and removed ones
// that neither a carrier nor an animation moves, and that are not around the place; `scene` may be
// null, and then they do not count. With an environment file, whose place nobody knows, only lamps
// that the set file itself calls captured count. Throws previz::Error if a captured lamp has this
// very place.
LampClaims claims_of(const set::Set& set, const scene::Scene* scene, const glm::dvec3& seen_from);

// Returns the emission (set::Light::emission) with which the lamp sends this flux, the integral of
// radiance over solid angle, to a place (world, metres). Returns nothing if it sends nothing there
// whatever its emission: a spot that shines elsewhere, the back of a rectangle.
std::optional<glm::dvec3> emission_for(const set::Light& light, const glm::dvec3& flux,
                                       const glm::dvec3& seen_from);

}  // namespace previz::pipeline
