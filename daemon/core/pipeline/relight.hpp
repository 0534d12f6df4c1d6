// Applies the crew's changes to the lamps that were taken out of the light around the set.
#pragma once

#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/core/pipeline/light.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

// A lamp that was found in the light camera's picture, for those who may change it.
struct FoundLamp {
  std::string name;               // "found 1"; the same from light frame to light frame
  glm::dvec3 direction{0, 0, 1};  // unit, towards it in the light's map
  double radius_rad = 0;
  // The same as seen from the light camera, which with a room is not the map's viewpoint.
  glm::dvec3 from_camera{0, 0, 1};
  double radius_from_camera_rad = 0;

  friend bool operator==(const FoundLamp&, const FoundLamp&) = default;
};

// Returns the lamps that were found in the light, also those that a light by the whole image still
// has in it; none that the set declares.
std::vector<FoundLamp> found_lamps(const Light& light);

// Returns whether the set file itself has a lamp of this name.
bool is_declared_lamp(const set::Set& set, const std::string& name);

// Returns for each direction (unit, where a lamp was when it was changed) the index of the lamp
// that is meant, if there is one near enough. The nearest are paired first, and no lamp is meant
// twice.
std::vector<std::optional<std::size_t>> lamps_meant(const std::vector<glm::dvec3>& directions,
                                                    const std::vector<FoundLamp>& lamps);

// Returns the light with the found lamps that the state changes as lamps of their own. It is the
// same light if it has them already, or has no image that they could still be part of.
LightPtr with_lamps_parted(const LightPtr& light, const set::Set& set,
                           const session::SceneState& state);

// Returns the light's lamps as the state has them, for render::Renderer::set_sources. A lamp of the
// set is meant by its name. Any other is meant by its direction, away from the lamp, because the
// number of a found lamp differs from one run to the next (lamps_meant).
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
