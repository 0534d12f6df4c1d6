// What the crew changed of a set's objects and lamps, as steps from where the set has them; and
// with what is moved by hand, where everything is.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <string>

#include "daemon/set/set.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

// Axes are the stage's, or those of the object's carrier.
struct ObjectEdit {
  glm::dvec3 offset_m{0};
  glm::dmat3 turn{1};  // through the object's origin
  double scale = 1;

  friend bool operator==(const ObjectEdit&, const ObjectEdit&) = default;
};
struct LightEdit {
  double stops = 0;  // brightness in the mixed world, factors of two
  double warm_stops = 0, green_stops = 0;

  friend bool operator==(const LightEdit&, const LightEdit&) = default;
};
struct Edits {
  std::map<std::string, ObjectEdit> objects;
  std::map<std::string, LightEdit> lights;

  friend bool operator==(const Edits&, const Edits&) = default;
};

// The object's transform with the edit put on `world_from_file`, which says where its origin is.
glm::dmat4 edited(const glm::dmat4& world_from_file, const ObjectEdit& edit);

// Half of warm_stops goes to red and is taken from blue; half of green_stops goes to green and is
// taken from both others.
glm::dvec3 tint(const LightEdit& edit);

// What moves without the crew's buttons.
struct Motion {
  session::Carriers carriers;
  double animation_s = 0;
};

// Everything that is not as the set has it, and everything that moves by itself or is carried.
// Names the set has not are left out.
session::SceneState scene_state(const set::Set& set, const Edits& edits, const Motion& motion = {});

}  // namespace previz::pipeline
