// The crew's changes to a set's objects and lamps, as steps from where the set has them. Together
// with what is moved by hand they say where everything is.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

// A change of one object. Its axes are the stage's, or the carrier's if the object has one.
struct ObjectEdit {
  glm::dvec3 offset_m{0};
  glm::dmat3 turn{1};  // about the object's origin
  double scale = 1;
  // The variant of its materials that it is shown in; absent: the one that it has.
  std::optional<std::string> variant = {};

  // Returns whether nothing but the variant is changed.
  bool is_of_look_alone() const { return variant && *this == ObjectEdit{.variant = variant}; }

  friend bool operator==(const ObjectEdit&, const ObjectEdit&) = default;
};
struct LightEdit {
  double stops = 0;  // brightness in the mixed world, factors of two
  double warm_stops = 0, green_stops = 0;
  // A lamp that was found in the light: the direction towards it in the light's map, which says
  // which one is meant.
  std::optional<glm::dvec3> found_towards = {};
  // The same lamp as seen from the light camera, when it was changed last: a unit vector towards
  // it, and its angular radius.
  glm::dvec3 found_from_camera{0, 0, 1};
  double found_radius_rad = 0;

  friend bool operator==(const LightEdit&, const LightEdit&) = default;
};
struct Edits {
  std::map<std::string, ObjectEdit> objects;
  std::map<std::string, LightEdit> lights;
  std::optional<bool> hides_tags = {};  // absent: as the set has it
  double environment_turn_rad = 0;      // of the environment file, counter-clockwise from above

  friend bool operator==(const Edits&, const Edits&) = default;
};

// What a frame of a take was recorded with, that buttons go on from in its review.
struct RecordedLook {
  std::map<std::string, std::string> variants = {};  // by object
  std::optional<bool> hides_tags = {};               // absent: as the set has it

  friend bool operator==(const RecordedLook&, const RecordedLook&) = default;
};

// Returns the object's transform: the edit applied to `world_from_file`, which says where the
// object's origin is.
glm::dmat4 edited(const glm::dmat4& world_from_file, const ObjectEdit& edit);

// Returns a factor for each channel: half of warm_stops is added to red and taken from blue; half
// of green_stops is added to green and taken from red and blue.
glm::dvec3 tint(const LightEdit& edit);

// Returns the turns (rad) about the stage's X, then Y, then Z axis that make up a rotation, as a
// set file has them.
glm::dvec3 angles_of(const glm::dmat3& rotation);

// The things that move without the crew's buttons.
struct Motion {
  session::Carriers carriers;
  double animation_s = 0;
};

// Returns the state of everything that is not as the set has it, moves by itself or is carried.
// Names that are not in the set are left out, but for lamps that were found in the light.
session::SceneState scene_state(const set::Set& set, const Edits& edits, const Motion& motion = {});

// Returns the state with the crew's changes on top of it: those of a take in review. An object's
// change has the stage's axes; what is nowhere stays so.
session::SceneState with_edits(session::SceneState state, const set::Set& set, const Edits& edits);

// Removes the changes of objects and lamps that the set does not have, and returns their names.
std::vector<std::string> drop_unknown(Edits& edits, const set::Set& set);

// Removes the changes to variants that the files of objects do not have, and returns them in words.
// `scene` is the set's.
std::vector<std::string> drop_unknown_variants(Edits& edits, const set::Set& set,
                                               const scene::Scene& scene);

}  // namespace previz::pipeline
