// Applies the crew's changes to the lamps that were taken out of the light around the set.
#pragma once

#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/pipeline/shot.hpp"
#include "daemon/set/set.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

// A lamp that was found in the light camera's picture, for those who may change it.
struct FoundLamp {
  std::string name;               // "found 1"; the same from light frame to light frame
  glm::dvec3 direction{0, 0, 1};  // unit, towards it
  double radius_rad = 0;

  friend bool operator==(const FoundLamp&, const FoundLamp&) = default;
};

// Returns the lamps that were found in the light, also those that a light by the whole image still
// has in it; none that the set declares.
std::vector<FoundLamp> found_lamps(const Light& light);

// Returns whether the set file itself has a lamp of this name.
bool is_declared_lamp(const set::Set& set, const std::string& name);

// Returns whether a lamp that is found towards `direction` (unit) is the one that was towards
// `known`.
bool is_same_lamp(const glm::dvec3& known, const glm::dvec3& direction, double radius_rad);

// Returns the light with the found lamps that the state changes as lamps of their own. It is the
// same light if it has them already, which is so unless the whole image lights the set.
LightPtr with_lamps_parted(const LightPtr& light, const set::Set& set,
                           const session::SceneState& state);

// Returns the light's lamps as the state has them, for render::Renderer::set_sources. A lamp of the
// set is meant by its name. Any other is meant by its direction, away from the lamp, because the
// number of a found lamp differs from one run to the next: it is the lamp that is nearest to it,
// unless none is near.
std::vector<set::Light> relit(const Light& light, const set::Set& set,
                              const session::SceneState& state);

// The states of lamps by name, as session::SceneState has them.
using LampStates = std::map<std::string, std::optional<session::LightState>>;

// Returns the states of lamps that are not among the set's own ([[light]]), which scene::place
// knows: those that relit() applies.
LampStates lamp_states_beside(const session::SceneState& state, const set::Set& set);
// Returns the names of those of which the light has no lamp.
std::set<std::string> unmatched(const Light& light, const set::Set& set,
                                const session::SceneState& state);

// Gives the set's measured lamps, the last of a scene's lamps, the emission that the light says.
// Returns true if that changes one.
bool give_emissions(const Light& light, const set::Set& set, std::vector<set::Light>& scene_lights);

}  // namespace previz::pipeline
