// The tables of lamps, and of the light around the set.
#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>

#include "daemon/core/set/pose.hpp"
#include "daemon/core/set/resolving.hpp"

namespace previz::set {
namespace {

// Decides whether a lamp is taken out of the light around the set.
void captured(Resolving& work, LightDraft& draft) {
  const auto& table = draft.given;
  Light& light = draft.light;
  const bool is_real = light.gain_real > 0 && light.carrier.empty();
  const bool is_filmed = work.set.lighting.from != LightFrom::set && !work.draft.environment;
  light.captured = draft.captured.value_or(is_real && is_filmed);
  if (light.captured && !is_real)
    work.problem(table, "captured",
                 "is for real lamps that stay in place; allowed: true with "
                 "gain_real above 0 and no carrier");
  if (!light.captured) work.exclude(table, {"cone_deg"}, "needs captured = true; remove it");
  light.measured = light.captured && !table.has("emission");
  const bool is_in_a_map = is_filmed || work.draft.environment;
  if ((!light.captured || !is_in_a_map) && !table.has("emission"))
    work.problem(table, "emission",
                 "is missing; allowed: 3 numbers, at least 0, like [10.0, 9.5, 8.0]");
}

// Makes `up` a unit vector at right angles to the direction.
void upright(Resolving& work, const Given& table, Light& light) {
  if (!table.has("up") && std::abs(light.direction.y) > 0.99) light.up = {0, 0, 1};
  const auto across = light.up - glm::dot(light.up, light.direction) * light.direction;
  if (glm::length(across) > 1e-6 * glm::length(light.up))
    light.up = glm::normalize(across);
  else
    work.problem(table, "up", "is parallel to the light's direction; allowed: any that is not");
}

void light(Resolving& work, const Given& table, Light& light) {
  using enum LightType;
  struct Use {
    const char* key;
    std::vector<LightType> required, allowed;
  };
  static const Use uses[] = {
      {"position_m", {point, spot, rectangle, sphere}, {}},
      {"direction", {spot, directional, rectangle}, {}},
      {"up", {}, {rectangle}},
      {"width_m", {rectangle}, {}},
      {"height_m", {rectangle}, {}},
      {"radius_m", {sphere}, {}},
      {"angular_radius_deg", {}, {directional}},
      {"inner_cone_deg", {}, {spot}},
      {"outer_cone_deg", {}, {spot}},
  };
  const std::string type = std::string("a ") + name_of(light.type) + " light";
  for (const auto& [key, required, allowed] : uses) {
    const bool is_required = std::ranges::find(required, light.type) != required.end();
    const bool is_allowed = std::ranges::find(allowed, light.type) != allowed.end();
    if (is_required && !table.has(key))
      work.problem(table, key, "is missing; " + type + " needs it");
    if (!is_required && !is_allowed)
      work.exclude(table, {key}, type + " does not have this; remove it");
  }
  if (table.good("direction")) {
    if (glm::length(light.direction) > 0)
      light.direction = glm::normalize(light.direction);
    else
      work.problem(table, "direction", "has zero length; allowed: any other vector");
  }
  if (light.type == rectangle && table.good("direction")) upright(work, table, light);
  if (light.type == spot && light.inner_cone_rad > light.outer_cone_rad)
    work.problem(table, "inner_cone_deg",
                 "is wider than outer_cone_deg; allowed: at most that, " +
                     codec::print_number(light.outer_cone_rad * 180 / std::numbers::pi));
}

void lights(Resolving& work) {
  std::map<std::string, Position> first;
  int number = 0;
  for (auto& draft : work.draft.lights) {
    ++number;
    if (draft.light.name.empty()) draft.light.name = "light " + std::to_string(number);
    const char* key = draft.given.has("name") ? "name" : "type";
    if (draft.given.good(key)) {
      work.once(first, draft.light.name, draft.given, key, codec::quote(draft.light.name),
                "each name once");
    }
    captured(work, draft);
    if (draft.given.good("type")) light(work, draft.given, draft.light);
    work.carried(draft.given, draft.light.carrier);
    work.set.lights.push_back(draft.light);
  }
}

void captured_lamps(Resolving& work) {
  std::map<std::string, Position> first;
  for (auto& draft : work.draft.captured_lamps) {
    const auto& table = draft.given;
    CapturedLamp& lamp = draft.lamp;
    if (table.good("name")) {
      if (lamp.name.empty()) work.problem(table, "name", "is empty; allowed: text");
      work.once(first, lamp.name, table, "name", codec::quote(lamp.name), "each name once");
      if (std::ranges::find(work.set.lights, lamp.name, &Light::name) != work.set.lights.end())
        work.problem(table, "name",
                     codec::quote(lamp.name) + " is also a [[light]]; allowed: each name once");
    }
    if (table.has("position_m"))
      work.exclude(table, {"direction"}, "conflicts with position_m; remove one of the two");
    else if (!table.has("direction"))
      work.problem(table, "direction", "is missing; allowed: 3 numbers, or position_m");
    if (table.good("direction")) {
      if (glm::length(lamp.direction) > 0)
        lamp.direction = glm::normalize(lamp.direction);
      else
        work.problem(table, "direction", "has zero length; allowed: any other vector");
    }
    if (work.set.lighting.from == LightFrom::set && !work.draft.environment && table.at)
      work.problems.add(*table.at, table.path,
                        "conflicts with lighting.from = \"set\", which captures no light");
    work.set.captured_lamps.push_back(lamp);
  }
}

void lighting(Resolving& work) {
  const auto& table = work.given("lighting");
  auto& lighting = work.set.lighting;
  if (work.draft.environment) {
    lighting.environment_as_written = work.draft.environment->string();
    lighting.environment = work.existing(table, "environment", *work.draft.environment);
  }
  if (work.given("lighting.room").at)
    work.exclude(
        work.given("lighting.sources"), {"distance_m"},
        "conflicts with [lighting.room], whose walls hold the lamps; remove one of the two");
  if (lighting.from == LightFrom::recording) {
    work.exclude(table, {"environment"}, "conflicts with from = \"recording\"; remove one");
    if (lighting.mode != LightMode::sources)
      work.problem(table, table.has("mode") ? "mode" : "from",
                   std::string("a recording has lamps but no light picture, so mode \"") +
                       name_of(lighting.mode) +
                       "\" is not available; allowed: mode = \"sources\", or from = \"camera\"");
  }
  if (table.good("resolution") && lighting.resolution != 0 &&
      !std::has_single_bit(static_cast<unsigned>(lighting.resolution)))
    work.problem(table, "resolution",
                 std::to_string(lighting.resolution) +
                     " is not a power of two; allowed: 0 or 1, 2, 4 ... 4096");
  if (table.has("unseen") && !table.good("unseen")) return;
  if (lighting.unseen == UnseenRule::constant) {
    if (!table.has("unseen_radiance"))
      work.problem(table, "unseen_radiance",
                   "is missing for unseen = \"constant\"; allowed: 3 numbers, at least 0");
    lighting.unseen_radiance = work.draft.unseen_radiance.value_or(glm::dvec3{0});
  } else {
    work.exclude(table, {"unseen_radiance"},
                 "needs unseen = \"constant\"; set it, or remove unseen_radiance");
  }
}

void room(Resolving& work) {
  const auto& table = work.given("lighting.room");
  if (!table.at) return;
  Room& room = work.draft.room;
  if (work.draft.room_file) {
    work.exclude(table, {"size_m"}, "conflicts with file; allowed: one of the two");
    room.file_as_written = work.draft.room_file->string();
    room.file = work.existing(table, "file", *work.draft.room_file);
  } else if (!table.has("size_m")) {
    work.problem(table, "size_m", "is missing; allowed: 3 numbers in m, or a file");
  }
  room.world_from_room = rigid_transform(work.draft.room_pose);
  if (work.set.lighting.environment)
    work.problems.add(*table.at, table.path,
                      "conflicts with lighting.environment, which is light from infinity");
  work.set.lighting.room = room;
}

}  // namespace

void resolve_lights(Resolving& work) {
  lights(work);
  captured_lamps(work);
  lighting(work);
  room(work);
}

}  // namespace previz::set
