#include "daemon/core/scene/placement.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "daemon/core/scene/transform.hpp"
#include "daemon/core/set/problems.hpp"

namespace previz::scene {
namespace {

void move_lamp(set::Light& light, const glm::dmat4& moved_from_set) {
  light.position = glm::dvec3(moved_from_set * glm::dvec4(light.position, 1));
  const auto turn = [&](const glm::dvec3& v) {
    const glm::dvec3 turned = glm::dmat3(moved_from_set) * v;
    return turned / glm::length(turned);
  };
  light.direction = turn(light.direction);
  light.up = turn(light.up);
}

// Moves everything that came from the set's object with this index.
void move_object(const Scene& scene, std::size_t object, const glm::dmat4& moved_from_set,
                 Placement& placement) {
  for (Instance& instance : placement.instances)
    if (instance.object == object)
      instance.world_from_object = moved_from_set * instance.world_from_object;
  for (std::size_t i = 0; i < scene.lights.size(); ++i)
    if (scene.light_objects[i] == object) move_lamp(placement.lights[i], moved_from_set);
}

void put_out(set::Light& light) {
  light.gain_mixed = light.gain_real = 0;
}

// Moves everything to its place in the animation. An instance that is flattened, or whose shape is
// past all numbers, is not seen.
void play(const Scene& scene, const Animation& animation, double time_s, Placement& placement) {
  const std::vector<glm::dmat4> now = world_from_nodes(animation, time_s);
  for (std::size_t i = 0; i < scene.deformations.size(); ++i) {
    const Deformation& deformation = scene.deformations[i];
    if (deformation.object != animation.object) continue;
    placement.shapes[i] = shape_at(deformation, animation, now, time_s);
    if (can_be_shown(placement.shapes[i], deformation.extent)) continue;
    placement.shapes[i] = shape_at_rest(deformation);
    Instance& instance = placement.instances[deformation.instance];
    instance.presence = 0;
    placement.unknown.push_back("\"" + set::one_line(instance.name) +
                                "\" cannot be shown at some times of its animation: "
                                "its joints or targets move vertices beyond 1e15; it is hidden "
                                "then");
  }
  for (const Animation::Use& use : animation.instances) {
    Instance& instance = placement.instances[use.what];
    instance.world_from_object = now[use.node] * use.node_from_object;
    if (!is_invertible(now[use.node])) instance.presence = 0;
  }
  if (animation.lights.empty()) return;
  const std::vector<glm::dmat4> rest = world_from_nodes_at_rest(animation);
  for (const Animation::Use& use : animation.lights)
    if (is_invertible(now[use.node]) && is_invertible(rest[use.node]))
      move_lamp(placement.lights[use.what], now[use.node] * glm::inverse(rest[use.node]));
    else
      put_out(placement.lights[use.what]);
}

// Takes an object out of both worlds. The object stays in the scene, so that it can return at once.
void take_away_object(const Scene& scene, std::size_t object, Placement& placement) {
  for (Instance& instance : placement.instances)
    if (instance.object == object) instance.presence = 0;
  for (std::size_t i = 0; i < scene.lights.size(); ++i)
    if (scene.light_objects[i] == object) put_out(placement.lights[i]);
}

void relight(set::Light& light, const session::LightState& state) {
  light.position = state.position;
  light.direction = state.direction;
  light.up = state.up;
  light.gain_mixed = state.gain_mixed;
  light.tint = state.tint;
}

}  // namespace

session::LightState state_of(const set::Light& light) {
  return {light.position, light.direction, light.up, light.gain_mixed, light.tint};
}

Placement place(const Scene& scene, const set::Set& set, const session::SceneState& state) {
  Placement placement{scene.instances, scene.lights, {}, {}};
  if (state.hides_tags) hide_tags(placement.instances, *state.hides_tags);
  for (const Deformation& deformation : scene.deformations)
    placement.shapes.push_back(shape_at_rest(deformation));
  if (state.animation_s)
    for (const Animation& animation : scene.animations)
      play(scene, animation, *state.animation_s, placement);
  for (const auto& [name, world_from_file] : state.objects) {
    const auto found = std::ranges::find(set.objects, name, &set::Object::name);
    if (found == set.objects.end()) {
      placement.unknown.push_back("object \"" + name + "\" was moved, but is not in this set");
      continue;
    }
    const auto index = static_cast<std::size_t>(found - set.objects.begin());
    if (!world_from_file)
      take_away_object(scene, index, placement);
    else if (*world_from_file != found->world_from_file)
      move_object(scene, index, *world_from_file * glm::inverse(found->world_from_file), placement);
  }
  for (const auto& [name, variant] : state.variants) {
    const auto found = std::ranges::find(set.objects, name, &set::Object::name);
    const auto index = static_cast<std::size_t>(found - set.objects.begin());
    const Variants* variants = found == set.objects.end() ? nullptr : variants_of(scene, index);
    if (variants && show_variant(*variants, variant, placement.instances)) continue;
    if (!variants && variant.empty() && found != set.objects.end()) continue;
    placement.unknown.push_back("object \"" + name + "\" was shown in variant \"" +
                                set::one_line(variant) + "\", which it does not have");
  }
  // The set's own lamps are the last of the scene's.
  const std::size_t first = scene.lights.size() - set.lights.size();
  for (const auto& [name, light] : state.lights) {
    const auto found = std::ranges::find(set.lights, name, &set::Light::name);
    if (found == set.lights.end()) {
      placement.unknown.push_back("light \"" + name + "\" was changed, but is not in this set");
      continue;
    }
    set::Light& placed =
        placement.lights[first + static_cast<std::size_t>(found - set.lights.begin())];
    if (light)
      relight(placed, *light);
    else
      put_out(placed);
  }
  return placement;
}

}  // namespace previz::scene
