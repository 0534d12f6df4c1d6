#include "daemon/pipeline/relight.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

namespace previz::pipeline {
namespace {

// A found lamp farther than this from where it was changed is another lamp.
constexpr double least_reach_rad = 0.052;  // 3 degrees
constexpr double reach_in_radii = 4;       // as SourceTracker follows it

double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0));
}

bool is_captured(const set::Set& set, const std::string& name) {
  return std::ranges::find(set.captured_lamps, name, &set::CapturedLamp::name) !=
         set.captured_lamps.end();
}

// Returns the index of the found lamp that a state of this direction means.
std::optional<std::size_t> lamp_meant(const std::vector<set::Light>& lamps,
                                      const glm::dvec3& direction) {
  std::optional<std::size_t> nearest;
  double least = 4;
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    if (lamps[i].captured) continue;
    const double angle = angle_between(lamps[i].direction, direction);
    if (angle < least && is_same_lamp(lamps[i].direction, direction, lamps[i].angular_radius_rad))
      least = angle, nearest = i;
  }
  return nearest;
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

bool is_same_lamp(const glm::dvec3& known, const glm::dvec3& direction, double radius_rad) {
  return angle_between(known, direction) <= std::max(least_reach_rad, reach_in_radii * radius_rad);
}

std::vector<FoundLamp> found_lamps(const Light& light) {
  std::vector<FoundLamp> found;
  const auto add = [&](const std::vector<set::Light>& lamps) {
    for (const set::Light& lamp : lamps) {
      const bool is_known = std::ranges::find(found, lamp.name, &FoundLamp::name) != found.end();
      if (lamp.captured || is_known) continue;
      found.push_back({lamp.name, -lamp.direction, lamp.angular_radius_rad});
    }
  };
  add(light.lamps);
  if (light.image_lamps) add(light.image_lamps->lamps);
  // By number, so that the order does not depend on what is parted from the image.
  std::ranges::stable_sort(
      found, {}, [](const FoundLamp& lamp) { return std::pair(lamp.name.size(), lamp.name); });
  return found;
}

LightPtr with_lamps_parted(const LightPtr& light, const set::Set& set,
                           const session::SceneState& state) {
  if (!light || !light->image_lamps) return light;
  const ImageLamps& all = *light->image_lamps;
  std::vector<bool> wanted(all.texels.size());
  for (const auto& [name, lamp] : state.lights) {
    if (!lamp || is_declared_lamp(set, name)) continue;
    if (const auto meant = lamp_meant(all.lamps, lamp->direction))
      wanted[static_cast<std::size_t>(all.regions[*meant])] = true;
  }
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
  for (const auto& [name, changed] : state.lights) {
    if (!changed) continue;
    if (is_captured(set, name)) {
      for (set::Light& lamp : lamps)
        if (lamp.captured && lamp.name == name) relight_found(lamp, *changed);
    } else if (!is_declared_lamp(set, name)) {
      if (const auto meant = lamp_meant(lamps, changed->direction))
        relight_found(lamps[*meant], *changed);
    }
  }
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
  std::set<std::string> names;
  for (const auto& [name, lamp] : lamp_states_beside(state, set)) {
    const bool is_found = lamp && lamp_meant(light.lamps, lamp->direction);
    if (!is_found && !is_captured(set, name)) names.insert(name);
  }
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
