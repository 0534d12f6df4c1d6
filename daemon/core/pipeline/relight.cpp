#include "daemon/core/pipeline/relight.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

namespace previz::pipeline {
namespace {

// A found lamp farther than this from where it was changed is another lamp. A wide one's middle
// wanders with what is cut off at its edge, and by about its radius when it is found in two parts.
constexpr double least_reach_rad = 0.052;  // 3 degrees
constexpr double reach_in_radii = 1.5;

double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0));
}

bool is_captured(const set::Set& set, const std::string& name) {
  return std::ranges::find(set.captured_lamps, name, &set::CapturedLamp::name) !=
         set.captured_lamps.end();
}

// The states of found lamps, and the lamps that they mean.
struct Meant {
  std::vector<const session::LightState*> states;
  std::vector<std::optional<std::size_t>> lamps;  // of each state: index into the lamps
  std::vector<std::string> names;                 // of each state
};

FoundLamp found_lamp(const set::Light& lamp) {
  return {lamp.name, -lamp.direction, lamp.angular_radius_rad};
}

// Pairs the states of found lamps with `lamps`, of which those that the set declares do not count.
Meant meant_by(const session::SceneState& state, const set::Set& set,
               const std::vector<set::Light>& lamps) {
  Meant meant;
  std::vector<glm::dvec3> towards;
  for (const auto& [name, lamp] : state.lights) {
    if (!lamp || is_declared_lamp(set, name)) continue;
    meant.states.push_back(&*lamp);
    meant.names.push_back(name);
    towards.push_back(-lamp->direction);
  }
  std::vector<FoundLamp> found;
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    if (lamps[i].captured) continue;
    found.push_back(found_lamp(lamps[i]));
    places.push_back(i);
  }
  meant.lamps = lamps_meant(towards, found);
  for (std::optional<std::size_t>& lamp : meant.lamps)
    if (lamp) lamp = places[*lamp];
  return meant;
}

void relight_found(set::Light& lamp, const session::LightState& state) {
  lamp.gain_mixed = state.gain_mixed;
  lamp.tint = state.tint;
}

}  // namespace

bool is_declared_lamp(const set::Set& set, const std::string& name) {
  return std::ranges::find(set.lights, name, &set::Light::name) != set.lights.end() ||
         std::ranges::find(set.captured_lamps, name, &set::CapturedLamp::name) !=
             set.captured_lamps.end();
}

std::vector<std::optional<std::size_t>> lamps_meant(const std::vector<glm::dvec3>& directions,
                                                    const std::vector<FoundLamp>& lamps) {
  struct Pair {
    double angle;
    std::size_t direction, lamp;
  };
  std::vector<Pair> pairs;
  for (std::size_t d = 0; d < directions.size(); ++d)
    for (std::size_t l = 0; l < lamps.size(); ++l) {
      const double angle = angle_between(directions[d], lamps[l].direction);
      if (angle <= std::max(least_reach_rad, reach_in_radii * lamps[l].radius_rad))
        pairs.push_back({angle, d, l});
    }
  std::ranges::stable_sort(pairs, {}, &Pair::angle);
  std::vector<std::optional<std::size_t>> meant(directions.size());
  std::vector<bool> is_taken(lamps.size());
  for (const Pair& pair : pairs) {
    if (meant[pair.direction] || is_taken[pair.lamp]) continue;
    meant[pair.direction] = pair.lamp;
    is_taken[pair.lamp] = true;
  }
  return meant;
}

std::vector<FoundLamp> found_lamps(const Light& light) {
  std::vector<FoundLamp> found;
  const auto add = [&](const std::vector<set::Light>& lamps) {
    for (const set::Light& lamp : lamps) {
      const bool is_known = std::ranges::find(found, lamp.name, &FoundLamp::name) != found.end();
      if (lamp.captured || is_known) continue;
      FoundLamp& one = found.emplace_back(found_lamp(lamp));
      one.from_camera = one.direction;
      one.radius_from_camera_rad = one.radius_rad;
      if (lamp.type != set::LightType::sphere) continue;
      const glm::dvec3 to_lamp = lamp.position - light.camera_place;
      const double distance = glm::length(to_lamp);
      if (!(distance > lamp.radius_m)) continue;
      one.from_camera = to_lamp / distance;
      one.radius_from_camera_rad = std::asin(lamp.radius_m / distance);
    }
  };
  add(light.lamps);
  if (light.image_lamps) add(light.image_lamps->lamps);
  // They are sorted by number, so that the order does not depend on what is parted from the image.
  std::ranges::stable_sort(
      found, {}, [](const FoundLamp& lamp) { return std::pair(lamp.name.size(), lamp.name); });
  return found;
}

LightPtr with_lamps_parted(const LightPtr& light, const set::Set& set,
                           const session::SceneState& state) {
  if (!light || !light->image_lamps) return light;
  const ImageLamps& all = *light->image_lamps;
  std::vector<bool> wanted(all.texels.size());
  std::vector<set::Light> lamps = light->lamps;  // those that are parted already, and the others
  const std::size_t first = lamps.size();
  lamps.insert(lamps.end(), all.lamps.begin(), all.lamps.end());
  for (const std::optional<std::size_t>& lamp : meant_by(state, set, lamps).lamps)
    if (lamp && *lamp >= first) wanted[static_cast<std::size_t>(all.regions[*lamp - first])] = true;
  if (std::ranges::none_of(wanted, [](bool is_wanted) { return is_wanted; })) return light;
  auto parted = std::make_shared<Light>(*light);
  auto left = std::make_shared<ImageLamps>(all);
  left->lamps.clear();
  left->regions.clear();
  for (std::size_t i = 0; i < all.lamps.size(); ++i) {
    const bool is_wanted = wanted[static_cast<std::size_t>(all.regions[i])];
    (is_wanted ? parted->lamps : left->lamps).push_back(all.lamps[i]);
    if (!is_wanted) left->regions.push_back(all.regions[i]);
  }
  lighting::EnvironmentMap& map = parted->lighting.environment;
  for (std::size_t r = 0; r < wanted.size(); ++r)
    if (wanted[r])
      for (const std::uint32_t t : all.texels[r]) map.radiance[t] = all.without->radiance[t];
  parted->image_lamps = std::move(left);
  parted->encoded = render::encode_environment(map);
  return parted;
}

std::vector<set::Light> relit(const Light& light, const set::Set& set,
                              const session::SceneState& state) {
  std::vector<set::Light> lamps = light.lamps;
  for (const auto& [name, changed] : state.lights)
    if (changed && is_captured(set, name))
      for (set::Light& lamp : lamps)
        if (lamp.captured && lamp.name == name) relight_found(lamp, *changed);
  const Meant meant = meant_by(state, set, lamps);
  for (std::size_t i = 0; i < meant.states.size(); ++i)
    if (meant.lamps[i]) relight_found(lamps[*meant.lamps[i]], *meant.states[i]);
  return lamps;
}

LampStates lamp_states_beside(const session::SceneState& state, const set::Set& set) {
  LampStates beside;
  for (const auto& [name, lamp] : state.lights)
    if (std::ranges::find(set.lights, name, &set::Light::name) == set.lights.end())
      beside.emplace(name, lamp);
  return beside;
}

std::set<std::string> unmatched(const Light& light, const set::Set& set,
                                const session::SceneState& state) {
  const Meant meant = meant_by(state, set, light.lamps);
  std::set<std::string> names;
  for (std::size_t i = 0; i < meant.names.size(); ++i)
    if (!meant.lamps[i]) names.insert(meant.names[i]);
  return names;
}

bool give_emissions(const Light& light, const set::Set& set,
                    std::vector<set::Light>& scene_lights) {
  const std::size_t first = scene_lights.size() - set.lights.size();
  bool is_changed = false;
  for (std::size_t i = 0; i < set.lights.size(); ++i) {
    const auto measured = light.emissions.find(set.lights[i].name);
    if (measured == light.emissions.end()) continue;
    is_changed |= scene_lights[first + i].emission != measured->second;
    scene_lights[first + i].emission = measured->second;
  }
  return is_changed;
}

}  // namespace previz::pipeline
