#include "daemon/core/session/json_lines.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_numbers.hpp"
#include "daemon/core/session/light_json.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

using Json = nlohmann::ordered_json;

double finite(double value, const char* key) {
  if (!std::isfinite(value))
    throw Error(std::string("a frame's ") + key + " must be a finite number to be recorded");
  return value;
}

std::string hex(std::uint32_t value) {
  std::array<char, 8> digits;
  digits.fill('0');
  std::array<char, 8> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value, 16).ptr;
  std::copy(text.data(), end, digits.end() - (end - text.data()));
  return {digits.begin(), digits.end()};
}

std::uint32_t from_hex(const std::string& text) {
  std::uint32_t value = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value, 16);
  if (text.size() != 8 || result.ec != std::errc{} || result.ptr != end)
    throw std::invalid_argument("not eight hexadecimal digits");
  return value;
}

void get(const Json& json, std::uint64_t& value) {
  value = number_of<std::uint64_t>(json);
}

void get(const Json& json, std::int64_t& value) {
  value = number_of<std::int64_t>(json);
}

void get(const Json& json, int& value) {
  value = number_of<int>(json);
}

void get(const Json& json, double& value) {
  value = number_of<double>(json);
}

void get(const Json& json, bool& value) {
  json.get_to(value);
}

void get(const Json& json, std::string& value) {
  json.get_to(value);
}

template <std::size_t N>
void get(const Json& json, std::array<double, N>& values) {
  if (!json.is_array() || json.size() != N) throw std::invalid_argument("wrong length");
  for (std::size_t i = 0; i < N; ++i) get(json[i], values[i]);
}

void get(const Json& json, std::vector<int>& values) {
  if (!json.is_array()) throw std::invalid_argument("not a list");
  for (const Json& item : json) get(item, values.emplace_back());
}

void get(const Json& json, glm::dvec3& value) {
  std::array<double, 3> numbers{};
  get(json, numbers);
  value = {numbers[0], numbers[1], numbers[2]};
}

// A 4x4 matrix is stored as 16 numbers, row by row.
void get(const Json& json, glm::dmat4& value) {
  std::array<double, 16> rows{};
  get(json, rows);
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) value[column][row] = rows[4 * row + column];
}

Json json_of(const glm::dmat4& matrix, const char* key = "object") {
  std::array<double, 16> rows{};
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      rows[4 * row + column] = finite(matrix[column][row], key);
  return rows;
}

Json json_of(const glm::dvec3& v, const char* key) {
  return Json::array({finite(v.x, key), finite(v.y, key), finite(v.z, key)});
}

Json json_of(const LightState& light) {
  return Json{{"position", json_of(light.position, "light position")},
              {"direction", json_of(light.direction, "light direction")},
              {"up", json_of(light.up, "light up")},
              {"gain_mixed", finite(light.gain_mixed, "light gain_mixed")},
              {"tint", json_of(light.tint, "light tint")}};
}

Json json_of(const CarrierState& carrier) {
  for (const double value : carrier.covariance) finite(value, "carrier covariance");
  return Json{{"world_from_carrier", json_of(carrier.world_from_carrier, "carrier")},
              {"covariance", carrier.covariance},
              {"tags", carrier.tags}};
}

void get(const Json& json, LightState& light) {
  get(json.at("position"), light.position);
  get(json.at("direction"), light.direction);
  get(json.at("up"), light.up);
  get(json.at("gain_mixed"), light.gain_mixed);
  get(json.at("tint"), light.tint);
}

void get(const Json& json, CarrierState& carrier) {
  get(json.at("world_from_carrier"), carrier.world_from_carrier);
  get(json.at("covariance"), carrier.covariance);
  get(json.at("tags"), carrier.tags);
}

template <typename Value>
void get(const Json& json, std::optional<Value>& value) {
  if (!json.is_null()) get(json, value.emplace());
}

// Reads the members of an object into the values of a map.
template <typename Value>
void get_members(const Json& json, const char* key, std::map<std::string, Value>& values) {
  if (!json.contains(key)) return;
  for (const auto& [name, value] : json.at(key).items()) get(value, values[name]);
}

template <typename Value>
Json json_of(const std::optional<Value>& value) {
  return value ? json_of(*value) : Json();
}

FrameLine parse_frame_line(const Json& json) {
  FrameLine line;
  get(json.at("frame"), line.record.frame);
  get(json.at("sequence"), line.record.sequence);
  get(json.at("timestamp_ns"), line.record.timestamp_ns);
  get(json.at("arrival_ns"), line.record.arrival_ns);
  get(json.at("exposure_s"), line.record.exposure_s);
  get(json.at("gain"), line.record.gain);
  get(json.at("exposure"), line.record.exposure);
  get(json.at("video_ms"), line.video_ms);
  line.crc32 = from_hex(json.at("crc32").get<std::string>());
  return line;
}

TrackRecord parse_track_line(const Json& json) {
  TrackRecord record;
  get(json.at("frame"), record.frame);
  get(json.at("timestamp_ns"), record.timestamp_ns);
  get(json.at("tracked"), record.tracked);
  get(json.at("tags"), record.tags);
  get_members(json, "objects", record.scene.objects);
  get_members(json, "lights", record.scene.lights);
  get_members(json, "variants", record.scene.variants);
  get_members(json, "carriers", record.carriers);
  if (json.contains("animation_s")) get(json.at("animation_s"), record.scene.animation_s.emplace());
  if (json.contains("hides_tags")) get(json.at("hides_tags"), record.scene.hides_tags.emplace());
  if (json.contains("environment_turn_rad"))
    get(json.at("environment_turn_rad"), record.scene.environment_turn_rad.emplace());
  if (json.contains("captured_light"))
    record.captured_light = captured_light_of(json.at("captured_light"));
  if (!record.tracked) return record;
  get(json.at("world_from_camera"), record.world_from_camera);
  get(json.at("covariance"), record.covariance);
  return record;
}

std::optional<ButtonEvent> parse_button_line(const Json& json) {
  if (!json.contains("button") && json.is_object()) return std::nullopt;
  ButtonEvent event;
  json.at("button").get_to(event.button);
  get(json.at("pressed"), event.pressed);
  get(json.at("timestamp_ns"), event.timestamp_ns);
  return event;
}

std::optional<MarkEvent> parse_mark_line(const Json& json) {
  if (!json.contains("mark") && json.is_object()) return std::nullopt;
  MarkEvent mark;
  json.at("mark").get_to(mark.point);
  get(json.at("timestamp_ns"), mark.timestamp_ns);
  if (json.contains("withdrawn")) get(json.at("withdrawn"), mark.is_withdrawn);
  if (mark.is_withdrawn) return mark;
  std::array<double, 2> px{};
  get(json.at("px"), px);
  mark.px = {px[0], px[1]};
  return mark;
}

bool in_order(const FrameLine& before, const FrameLine& line) {
  return before.record.frame < line.record.frame;
}
bool in_order(const TrackRecord& before, const TrackRecord& record) {
  return before.frame < record.frame;
}
// Events of several devices are written as they arrive, so any order is right.
bool in_order(const ButtonEvent&, const ButtonEvent&) {
  return true;
}
bool in_order(const MarkEvent&, const MarkEvent&) {
  return true;
}

// `parse` returns nothing for a line of another kind.
template <typename Record, typename Parse>
Lines<Record> read_lines(const std::filesystem::path& file, Parse parse) {
  Lines<Record> lines;
  if (!std::filesystem::exists(std::filesystem::symlink_status(file))) return lines;
  PlainLines from(file);
  std::string text;
  for (std::uint64_t number = 1; from.next(text); ++number) {
    try {
      std::optional<Record> record = parse(Json::parse(text));
      if (!record) continue;
      if (!lines.records.empty() && !in_order(lines.records.back(), *record))
        throw std::invalid_argument("frames go backwards");
      lines.records.push_back(std::move(*record));
    } catch (const std::exception&) {
      lines.bad_lines.push_back(number);
      if (lines.bad_lines.size() == most_bad_lines) break;
    }
  }
  return lines;
}

}  // namespace

std::string to_line(const FrameLine& line) {
  const FrameRecord& record = line.record;
  return Json{{"frame", record.frame},
              {"sequence", record.sequence},
              {"timestamp_ns", record.timestamp_ns},
              {"arrival_ns", record.arrival_ns},
              {"exposure_s", finite(record.exposure_s, "exposure_s")},
              {"gain", finite(record.gain, "gain")},
              {"exposure", finite(record.exposure, "exposure")},
              {"video_ms", line.video_ms},
              {"crc32", hex(line.crc32)}}
      .dump();
}

std::string to_line(const TrackRecord& record) {
  Json json{{"frame", record.frame},
            {"timestamp_ns", record.timestamp_ns},
            {"tracked", record.tracked},
            {"tags", record.tags}};
  if (record.tracked) {
    for (const double value : record.covariance) finite(value, "covariance");
    json["world_from_camera"] = json_of(record.world_from_camera, "world_from_camera");
    json["covariance"] = record.covariance;
  }
  for (const auto& [name, world_from_file] : record.scene.objects)
    json["objects"][name] = json_of(world_from_file);
  for (const auto& [name, light] : record.scene.lights) json["lights"][name] = json_of(light);
  for (const auto& [name, variant] : record.scene.variants) json["variants"][name] = variant;
  for (const auto& [name, carrier] : record.carriers) json["carriers"][name] = json_of(carrier);
  if (record.scene.animation_s)
    json["animation_s"] = finite(*record.scene.animation_s, "animation_s");
  if (record.scene.hides_tags) json["hides_tags"] = *record.scene.hides_tags;
  if (record.scene.environment_turn_rad)
    json["environment_turn_rad"] = *record.scene.environment_turn_rad;
  if (record.captured_light) json["captured_light"] = to_json(*record.captured_light);
  return json.dump();
}

std::string to_line(const ButtonEvent& event) {
  return Json{
      {"timestamp_ns", event.timestamp_ns}, {"button", event.button}, {"pressed", event.pressed}}
      .dump();
}

std::string to_line(const MarkEvent& mark) {
  Json json{{"timestamp_ns", mark.timestamp_ns}, {"mark", mark.point}};
  if (mark.is_withdrawn)
    json["withdrawn"] = true;
  else
    json["px"] = {finite(mark.px.x, "mark px"), finite(mark.px.y, "mark px")};
  return json.dump();
}

std::string to_line(std::int64_t timestamp_ns, const std::string& event) {
  return Json{{"timestamp_ns", timestamp_ns}, {"event", event}}.dump();
}

Lines<FrameLine> read_frame_lines(const std::filesystem::path& file) {
  return read_lines<FrameLine>(file, parse_frame_line);
}

Lines<TrackRecord> read_track_lines(const std::filesystem::path& file) {
  return read_lines<TrackRecord>(file, parse_track_line);
}

Lines<ButtonEvent> read_button_lines(const std::filesystem::path& file) {
  return read_lines<ButtonEvent>(file, parse_button_line);
}

Lines<MarkEvent> read_mark_lines(const std::filesystem::path& file) {
  return read_lines<MarkEvent>(file, parse_mark_line);
}

}  // namespace previz::session
