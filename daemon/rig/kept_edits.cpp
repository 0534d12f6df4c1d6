#include "daemon/rig/kept_edits.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "daemon/core/set/file_edit.hpp"
#include "drivers/keys/value.hpp"

namespace previz::rig {
namespace {

constexpr double per_degree = 180 / std::numbers::pi;
constexpr double metre_steps = 1e6, degree_steps = 1e4;  // in one

std::string printed(double value, double steps) {
  return codec::print_number(std::round(value * steps) / steps + 0.0);
}

std::string printed(const glm::dvec3& v, double steps) {
  return '[' + printed(v.x, steps) + ", " + printed(v.y, steps) + ", " + printed(v.z, steps) + ']';
}

// Gains and tints are kept to seven digits, however small they are.
std::string printed(double value) {
  return codec::print_number(std::stod(fmt::format("{:.7g}", value)));
}
std::string printed(const glm::dvec3& v) {
  return '[' + printed(v.x) + ", " + printed(v.y) + ", " + printed(v.z) + ']';
}

std::string printed(const glm::dmat4& m) {
  std::string text = "[";
  for (int row = 0; row < 4; ++row) {
    text += row > 0 ? ", [" : "[";
    for (int column = 0; column < 4; ++column)
      text += (column > 0 ? ", " : "") + codec::print_number(m[column][row] + 0.0);
    text += ']';
  }
  return text + ']';
}

void put_object(std::size_t index, const set::Object& object, const pipeline::ObjectEdit& edit,
                set::FileEdit& file) {
  if (edit.variant) file.put("object", index, "variant", codec::quote(*edit.variant));
  if (edit.is_of_look_alone()) return;
  const glm::dmat4 placed = pipeline::edited(object.world_from_file, edit);
  if (file.has("object", index, "world_from_file"))
    return file.put("object", index, "world_from_file", printed(placed));
  const double scale = glm::length(glm::dvec3(placed[0]));
  if (edit.offset_m != glm::dvec3(0))
    file.put("object", index, "position_m", printed(glm::dvec3(placed[3]), metre_steps));
  if (edit.turn != glm::dmat3(1))
    file.put("object", index, "rotation_deg",
             printed(pipeline::angles_of(glm::dmat3(placed) / scale) * per_degree, degree_steps));
  if (edit.scale != 1) file.put("object", index, "scale", printed(scale, metre_steps));
}

void put_lamp(const char* tables, std::size_t index, double gain_mixed, const glm::dvec3& tint,
              const pipeline::LightEdit& edit, set::FileEdit& file) {
  if (edit.stops != 0)
    file.put(tables, index, "gain_mixed", printed(gain_mixed * std::exp2(edit.stops)));
  if (edit.warm_stops != 0 || edit.green_stops != 0)
    file.put(tables, index, "tint", printed(tint * pipeline::tint(edit)));
}

void put_tags(bool hidden, set::FileEdit& file) {
  const char* value = hidden ? "true" : "false";
  if (file.count("tags") > 0) return file.put("tags", 0, "hide", value);
  file.append(fmt::format("[tags]\nhide = {}\n", value));
}

void put_environment_turn(double rotation_rad, set::FileEdit& file) {
  const std::string value = printed(rotation_rad * per_degree, degree_steps);
  file.put("lighting", 0, "environment_rotation_deg", value);
}

// A cone that holds the lamp, its blurred edge and what it may be off by from frame to frame.
std::string captured_table(const std::string& name, const pipeline::LightEdit& edit) {
  const double cone_deg = std::min(60.0, 1.2 * edit.found_radius_rad * per_degree + 1.5);
  return "[[captured_light]]\nname = " + codec::quote(name) +
         "\ndirection = " + printed(edit.found_from_camera, metre_steps) +
         "\ncone_deg = " + printed(cone_deg, degree_steps) +
         "\ngain_mixed = " + printed(std::exp2(edit.stops)) +
         "\ntint = " + printed(pipeline::tint(edit)) + "\n";
}

}  // namespace

std::string with_edits(const std::string& text, const set::Set& set, const pipeline::Edits& edits) {
  set::FileEdit file(text);
  if (edits.hides_tags) put_tags(*edits.hides_tags, file);
  if (edits.environment_turn_rad != 0 && set.lighting.environment)
    put_environment_turn(set.lighting.environment_rotation_rad + edits.environment_turn_rad, file);
  for (std::size_t i = 0; i < set.objects.size(); ++i)
    if (const auto edit = edits.objects.find(set.objects[i].name); edit != edits.objects.end())
      put_object(i, set.objects[i], edit->second, file);
  for (std::size_t i = 0; i < set.lights.size(); ++i)
    if (const auto edit = edits.lights.find(set.lights[i].name); edit != edits.lights.end())
      put_lamp("light", i, set.lights[i].gain_mixed, set.lights[i].tint, edit->second, file);
  for (std::size_t i = 0; i < set.captured_lamps.size(); ++i) {
    const set::CapturedLamp& lamp = set.captured_lamps[i];
    if (const auto edit = edits.lights.find(lamp.name); edit != edits.lights.end())
      put_lamp("captured_light", i, lamp.gain_mixed, lamp.tint, edit->second, file);
  }
  for (const auto& [name, edit] : edits.lights)
    if (edit.found_towards) file.append(captured_table(name, edit));
  return file.text();
}

}  // namespace previz::rig
