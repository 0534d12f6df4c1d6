#include "daemon/pipeline/edits.hpp"

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

session::SceneState scene_state(const set::Set& set, const Edits& edits) {
  session::SceneState state;
  for (const set::Object& object : set.objects) {
    const auto edit = edits.objects.find(object.name);
    if (edit != edits.objects.end())
      state.objects[object.name] = edited(object.world_from_file, edit->second);
  }
  for (const set::Light& light : set.lights) {
    const auto edit = edits.lights.find(light.name);
    if (edit == edits.lights.end()) continue;
    session::LightState& now = state.lights[light.name] = scene::state_of(light);
    now.gain_mixed *= std::exp2(edit->second.stops);
    now.tint = tint(edit->second);
  }
  return state;
}

}  // namespace previz::pipeline
