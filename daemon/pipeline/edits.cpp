#include "daemon/pipeline/edits.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/scene/placement.hpp"

namespace previz::pipeline {

glm::dmat4 edited(const glm::dmat4& world_from_file, const ObjectEdit& edit) {
  const glm::dvec3 origin(world_from_file[3]);
  glm::dmat4 moved =
      glm::dmat4(edit.turn * edit.scale) * glm::translate(glm::dmat4(1), -origin) * world_from_file;
  moved[3] += glm::dvec4(origin + edit.offset_m, 0);
  return moved;
}

glm::dvec3 tint(const LightEdit& edit) {
  const double warm = edit.warm_stops / 2, green = edit.green_stops / 2;
  return {std::exp2(warm - green), std::exp2(green), std::exp2(-warm - green)};
}

namespace {

// Returns the frame that an object's or a lamp's pose is given in: the stage's, or its carrier's.
// Returns nothing if the carrier was not found yet.
std::optional<glm::dmat4> world_from(const std::string& carrier,
                                     const session::Carriers& carriers) {
  if (carrier.empty()) return glm::dmat4(1);
  const auto found = carriers.find(carrier);
  if (found == carriers.end()) return std::nullopt;
  return found->second.world_from_carrier;
}

// `world_from_carrier` is rigid.
void carry(session::LightState& light, const glm::dmat4& world_from_carrier) {
  const glm::dmat3 turn(world_from_carrier);
  light.position = glm::dvec3(world_from_carrier * glm::dvec4(light.position, 1));
  light.direction = turn * light.direction;
  light.up = turn * light.up;
}

}  // namespace

session::SceneState scene_state(const set::Set& set, const Edits& edits, const Motion& motion) {
  session::SceneState state;
  if (std::ranges::any_of(set.objects, [](const auto& o) { return !o.animation.empty(); }))
    state.animation_s = motion.animation_s;
  for (const set::Object& object : set.objects) {
    const auto edit = edits.objects.find(object.name);
    const bool is_edited = edit != edits.objects.end();
    if (!is_edited && object.carrier.empty()) continue;
    std::optional<glm::dmat4>& now = state.objects[object.name];
    now = world_from(object.carrier, motion.carriers);
    if (now)
      *now *= is_edited ? edited(object.world_from_file, edit->second) : object.world_from_file;
  }
  for (const set::Light& light : set.lights) {
    const auto edit = edits.lights.find(light.name);
    const bool is_edited = edit != edits.lights.end();
    if (!is_edited && light.carrier.empty()) continue;
    std::optional<session::LightState>& now = state.lights[light.name];
    const std::optional<glm::dmat4> frame = world_from(light.carrier, motion.carriers);
    if (!frame) continue;
    now = scene::state_of(light);
    if (!light.carrier.empty()) carry(*now, *frame);
    if (!is_edited) continue;
    now->gain_mixed *= std::exp2(edit->second.stops);
    now->tint *= tint(edit->second);
  }
  return state;
}

}  // namespace previz::pipeline
