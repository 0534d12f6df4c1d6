#include "daemon/core/pipeline/edits.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <iterator>
#include <numbers>

#include "daemon/core/pipeline/relight.hpp"
#include "daemon/core/scene/placement.hpp"

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

session::LightState state_of(const set::CapturedLamp& lamp) {
  session::LightState state;
  state.direction = -lamp.direction;
  state.gain_mixed = lamp.gain_mixed;
  state.tint = lamp.tint;
  return state;
}

void relight(const LightEdit& edit, session::LightState& light) {
  light.gain_mixed *= std::exp2(edit.stops);
  light.tint *= tint(edit);
}

}  // namespace

session::SceneState scene_state(const set::Set& set, const Edits& edits, const Motion& motion) {
  session::SceneState state;
  state.hides_tags = edits.hides_tags;
  if (edits.environment_turn_rad != 0) state.environment_turn_rad = edits.environment_turn_rad;
  if (std::ranges::any_of(set.objects, [](const auto& o) { return !o.animation.empty(); }))
    state.animation_s = motion.animation_s;
  for (const set::Object& object : set.objects) {
    const auto edit = edits.objects.find(object.name);
    const bool is_edited = edit != edits.objects.end();
    if (is_edited && edit->second.variant) state.variants[object.name] = *edit->second.variant;
    const bool is_moved = is_edited && !edit->second.is_of_look_alone();
    if (!is_moved && object.carrier.empty()) continue;
    std::optional<glm::dmat4>& now = state.objects[object.name];
    now = world_from(object.carrier, motion.carriers);
    if (now)
      *now *= is_moved ? edited(object.world_from_file, edit->second) : object.world_from_file;
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
    if (is_edited) relight(edit->second, *now);
  }
  for (const set::CapturedLamp& lamp : set.captured_lamps) {
    const auto edit = edits.lights.find(lamp.name);
    if (edit == edits.lights.end()) continue;
    session::LightState now = state_of(lamp);
    relight(edit->second, now);
    state.lights[lamp.name] = now;
  }
  for (const auto& [name, edit] : edits.lights) {
    if (!edit.found_towards || state.lights.contains(name)) continue;
    session::LightState now;
    now.direction = -*edit.found_towards;
    relight(edit, now);
    state.lights[name] = now;
  }
  return state;
}

glm::dvec3 angles_of(const glm::dmat3& rotation) {
  // rotation = Rz(z) Ry(y) Rx(x); at y of a quarter turn, x and z are one turn, which is given to
  // z.
  const double sine = std::clamp(-rotation[0][2], -1.0, 1.0);
  if (std::abs(sine) > 1 - 1e-12)
    return {0, std::copysign(std::numbers::pi / 2, sine),
            std::atan2(-rotation[1][0], rotation[1][1])};
  return {std::atan2(rotation[1][2], rotation[2][2]), std::asin(sine),
          std::atan2(rotation[0][1], rotation[0][0])};
}

namespace {

// Returns the names of the states that changes of found lamps mean, by the names of the changes.
std::map<std::string, std::string> states_meant(const session::SceneState& state,
                                                const set::Set& set, const Edits& edits) {
  std::vector<std::string> changed;
  std::vector<glm::dvec3> towards;
  for (const auto& [name, edit] : edits.lights)
    if (edit.found_towards) changed.push_back(name), towards.push_back(*edit.found_towards);
  std::vector<FoundLamp> known;
  for (const auto& [name, lamp] : state.lights)
    if (lamp && !is_declared_lamp(set, name)) known.push_back({name, -lamp->direction});
  std::map<std::string, std::string> meant;
  const auto pairs = lamps_meant(towards, known);
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (pairs[i]) meant[changed[i]] = known[*pairs[i]].name;
  return meant;
}

// Returns the state of the lamp that a change means: as it is in `state`, or else as the set has
// it.
session::LightState& state_of_edited(const std::string& name, const LightEdit& edit,
                                     const std::map<std::string, std::string>& meant,
                                     const set::Set& set, session::SceneState& state) {
  if (edit.found_towards) {
    if (const auto known = meant.find(name); known != meant.end())
      return *state.lights[known->second];
    std::string free = name;
    while (state.lights.contains(free)) free += '+';
    session::LightState& lamp = state.lights[free].emplace();
    lamp.direction = -*edit.found_towards;
    return lamp;
  }
  std::optional<session::LightState>& now = state.lights[name];
  if (now) return *now;
  const auto light = std::ranges::find(set.lights, name, &set::Light::name);
  if (light != set.lights.end()) return now.emplace(scene::state_of(*light));
  return now.emplace(
      state_of(*std::ranges::find(set.captured_lamps, name, &set::CapturedLamp::name)));
}

}  // namespace

session::SceneState with_edits(session::SceneState state, const set::Set& set, const Edits& edits) {
  if (edits.hides_tags) state.hides_tags = edits.hides_tags;
  for (const auto& [name, edit] : edits.objects) {
    const auto object = std::ranges::find(set.objects, name, &set::Object::name);
    if (object == set.objects.end()) continue;
    if (edit.variant) state.variants[name] = *edit.variant;
    if (edit.is_of_look_alone()) continue;
    const auto [now, is_new] = state.objects.try_emplace(name, object->world_from_file);
    if (now->second) now->second = edited(*now->second, edit);
  }
  const std::map<std::string, std::string> meant = states_meant(state, set, edits);
  for (const auto& [name, edit] : edits.lights) {
    const auto is_nowhere = state.lights.find(name);
    if (is_nowhere != state.lights.end() && !is_nowhere->second) continue;
    if (edit.found_towards || is_declared_lamp(set, name))
      relight(edit, state_of_edited(name, edit, meant, set, state));
  }
  return state;
}

std::vector<std::string> drop_unknown(Edits& edits, const set::Set& set) {
  std::vector<std::string> unknown;
  std::erase_if(edits.objects, [&](const auto& entry) {
    const auto object = std::ranges::find(set.objects, entry.first, &set::Object::name);
    const bool is_there =
        object != set.objects.end() && object->presence == set::Presence::virtual_object;
    if (!is_there) unknown.push_back(entry.first);
    return !is_there;
  });
  std::erase_if(edits.lights, [&](const auto& entry) {
    const bool is_there = entry.second.found_towards || is_declared_lamp(set, entry.first);
    if (!is_there) unknown.push_back(entry.first);
    return !is_there;
  });
  return unknown;
}

std::vector<std::string> drop_unknown_variants(Edits& edits, const set::Set& set,
                                               const scene::Scene& scene) {
  std::vector<std::string> unknown;
  const auto has = [&](const std::string& name, const std::string& variant) {
    const auto object = std::ranges::find(set.objects, name, &set::Object::name);
    const scene::Variants* known =
        scene::variants_of(scene, static_cast<std::size_t>(object - set.objects.begin()));
    return known && std::ranges::find(known->names, variant) != known->names.end();
  };
  for (auto at = edits.objects.begin(); at != edits.objects.end();) {
    auto& [name, edit] = *at;
    const bool is_unknown = edit.variant && !edit.variant->empty() && !has(name, *edit.variant);
    if (is_unknown) {
      unknown.push_back("\"" + *edit.variant + "\" of \"" + name + "\"");
      edit.variant.reset();
    }
    at = is_unknown && edit == ObjectEdit{} ? edits.objects.erase(at) : std::next(at);
  }
  return unknown;
}

}  // namespace previz::pipeline
