#include "daemon/core/session/session_toml.hpp"

#include <toml++/toml.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>
#include <type_traits>
#include <utility>

#include "daemon/core/session/files.hpp"
#include "drivers/box/reading.hpp"
#include "drivers/calibration/read.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/toml_value.hpp"

namespace previz::session {
namespace {

// ---- writing

// The shortest text that comes back bit for bit; a TOML float has a point or an exponent.
std::string to_text(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  const std::string text(buffer.data(), end);
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;  // "inf", "nan" too
}

template <typename Range>
std::string to_list(const Range& values) {
  std::string text = "[";
  for (const double value : values) text += (text.size() > 1 ? ", " : "") + to_text(value);
  return text + "]";
}

std::string quote(std::string_view text) {
  constexpr char digits[] = "0123456789ABCDEF";
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\')
      (quoted += '\\') += c;
    else if (c == '\n')
      quoted += "\\n";
    else if (code < 0x20 || code == 0x7f)
      ((quoted += "\\u00") += digits[code >> 4]) += digits[code & 15];
    else
      quoted += c;
  }
  return quoted + '"';
}

bool reads_back(const std::string& assignment, const std::string& text) {
  try {
    return toml::parse(assignment)["text"].value<std::string>() == text;
  } catch (const toml::parse_error&) {
    return false;
  }
}

// Returns the text, which may be the name of a file, as UTF-8: where it is not, every byte that is
// not ASCII becomes a question mark.
std::string in_utf8(std::string text) {
  if (!reads_back("text = " + quote(text), text))
    for (char& c : text) c = static_cast<unsigned char>(c) < 0x80 ? c : '?';
  return text;
}

// Writes a set's text in the most readable form that preserves it byte for byte.
std::string text_assignment(const std::string& text) {
  std::string literal = "text = '''\n" + text + "'''\n";
  if (reads_back(literal, text)) return literal;
  std::string escaped = "text = " + quote(text) + "\n";
  if (reads_back(escaped, text)) return escaped;
  return "text_base64 = \"" + base64(std::as_bytes(std::span(text))) +
         "\"  # the set file is not UTF-8\n";
}

std::string line(const char* key, double value) {
  return std::string(key) + " = " + to_text(value) + "\n";
}

std::string line(const char* key, int value) {
  return std::string(key) + " = " + std::to_string(value) + "\n";
}

// Writes a calibration's values to the last bit.
struct ValueText {
  std::string operator()(const int* value) const { return std::to_string(*value); }
  std::string operator()(const double* value) const { return to_text(*value); }
  std::string operator()(const ResponseCurve::Kind* kind) const { return quote(name_of(*kind)); }
  std::string operator()(const glm::dvec3* v) const {
    return to_list(std::array{v->x, v->y, v->z});
  }
  std::string operator()(const std::optional<glm::dvec3>*) const { return ""; }  // is not recorded
  std::string operator()(const std::optional<glm::dmat4>* matrix) const {
    std::array<double, 16> rows{};
    for (int i = 0; i < 16; ++i) rows[i] = (**matrix)[i % 4][i / 4];
    return to_list(rows) + "  # row-major, metres";
  }
  template <typename List>
  std::string operator()(const List* values) const {
    return to_list(*values);
  }
};

// Splits a path such as "lens.f_number" into its table and key; the table of "fx" is "".
std::pair<std::string, std::string> table_and_key(const std::string& path) {
  const auto dot = path.find('.');
  return dot == std::string::npos ? std::pair{std::string(), path}
                                  : std::pair{path.substr(0, dot), path.substr(dot + 1)};
}

bool is_not_zero(const calibration::Key& row) {
  return row.is_recorded_if_not_zero && *std::get<double*>(row.to) != 0;
}

template <typename Draft>
std::string calibration_toml(const std::string& table, const std::string& comment, bool has_lens,
                             Draft draft) {
  const std::vector<calibration::Key> rows = keys(draft);
  const bool one_is_not_zero = std::ranges::any_of(rows, is_not_zero);
  std::string text;
  for (const std::string part : {"", "response", "lens"}) {
    if (part == "lens" && !has_lens) continue;
    text += "\n[" + table + (part.empty() ? "]" + comment : "." + part + "]") + "\n";
    for (const calibration::Key& row : rows) {
      if (row.is_recorded_if_not_zero && !one_is_not_zero) continue;
      const auto [home, key] = table_and_key(row.recorded);
      if (key.empty() || home != part) continue;
      if (row.only_with.value_or(draft.calibration.response.kind) ==
          draft.calibration.response.kind)
        text += key + " = " + std::visit(ValueText{}, row.to) + "\n";
    }
  }
  return text;
}

std::string observer_toml(const ObserverCalibration& calibration) {
  return calibration_toml(
      "observer.calibration", "  # pixels; Brown-Conrady in OpenCV's order",
      calibration.lens.has_value(),
      calibration::ObserverDraft{calibration, calibration.lens.value_or(ThinLens{})});
}

std::string light_toml(const LightCameraCalibration& calibration) {
  return calibration_toml(
      "light.calibration", "  # pixels; Kannala-Brandt", false,
      calibration::LightCameraDraft{calibration, {{}, {}, calibration.world_from_camera}});
}

std::string stream_toml(const std::string& source, const StreamFormat& stream) {
  std::string text = "\n[" + source + ".video]\nformat = " + quote(to_string(stream.format)) + "\n";
  text += line("width", stream.width) + line("height", stream.height);
  if (stream.codec == VideoCodec::raw) text += "codec = \"raw\"\n";
  if (stream.bayer != BayerPattern::none)
    text += "bayer = " + quote(to_string(stream.bayer)) + "\n";
  if (stream.frames) text += "frames = " + std::to_string(*stream.frames) + "\n";
  return text;
}

struct LossKey {
  const char* key;
  std::uint64_t Losses::*count;
};
constexpr LossKey loss_keys[] = {{"lost_frames", &Losses::frames},
                                 {"lost_shown", &Losses::shown},
                                 {"lost_records", &Losses::records}};

std::string losses_toml(const Losses& lost) {
  constexpr std::uint64_t most = std::numeric_limits<std::int64_t>::max();  // of a TOML integer
  std::string text;
  for (const auto& [key, count] : loss_keys)
    if (lost.*count > 0)
      text += std::string(key) + " = " + std::to_string(std::min(lost.*count, most)) + "\n";
  return text;
}

std::string missing_toml(const std::vector<MissingAsset>& missing) {
  if (missing.empty()) return {};
  std::string text = "\n[missing_assets]  # as the set writes them; not in this directory\n";
  for (const MissingAsset& asset : missing) {
    text += quote(asset.as_written) + " = {file = " + quote(in_utf8(asset.file.string()));
    if (!asset.sha256.empty()) text += ", sha256 = " + quote(asset.sha256);
    text += ", why = " + quote(in_utf8(asset.why)) + "}\n";
  }
  return text;
}

std::string take_toml(const TakeInfo& take) {
  return "\n[take]  # as on the board\n" + line("number", take.number) +
         "slate = " + quote(take.slate) + "\ntimecode = " + quote(take.timecode) +
         "  # of the first observer frame, time of day\n" +
         line("timecode_fps", take.timecode_fps) + "notes = " + quote(take.notes) +
         "\ngood = " + (take.good ? "true" : "false") + "\n";
}

std::string timecode_toml(const Timecode& timecode) {
  return "\n[timecode]  # of the first observer frame, as the clip had it\nfirst = " +
         quote(timecode.first) + "\n" + line("fps", timecode.fps);
}

// ---- reading

// Says where a value is looked for, so that an error can name it.
struct Place {
  const std::filesystem::path& file;
  const toml::table& table;
  std::string name;  // dotted; empty at the top

  std::string key(const char* k) const { return name.empty() ? k : name + "." + k; }

  [[noreturn]] void fail(const char* k, const std::string& what) const {
    const toml::node* node = table.get(k);
    const auto at = (node ? node->source() : table.source()).begin.line;
    throw Error(file.string() + ":" + std::to_string(at) + ": " + key(k) + " " + what);
  }

  // toml++ would cast a number with a fraction, or beyond all whole ones, to a whole one.
  template <typename Value>
  std::optional<Value> value_of(const char* k) const {
    if constexpr (std::is_same_v<Value, std::int64_t>)
      return table[k].value_exact<Value>();
    else
      return table[k].value<Value>();
  }
  template <typename Value>
  Value get(const char* k, const char* allowed) const {
    const auto value = value_of<Value>(k);
    if (!value) fail(k, table.contains(k) ? std::string("must be ") + allowed : "is missing");
    return *value;
  }
  double number(const char* k) const { return get<double>(k, "a number"); }
  int pixels(const char* k) const {
    const auto value = get<std::int64_t>(k, "a whole number of pixels");
    if (value < 1 || value > 65535) fail(k, "must be between 1 and 65535 pixels");
    return static_cast<int>(value);
  }
  std::string text(const char* k) const { return get<std::string>(k, "a string"); }
  const toml::table* find(const char* k) const {
    if (table.contains(k) && !table[k].is_table()) fail(k, "must be a table");
    return table[k].as_table();
  }
  Place inner(const char* k) const {
    const toml::table* found = find(k);
    if (!found) fail(k, "is missing");
    return {file, *found, key(k)};
  }
};

calibration::Source calibration_source(const Place& place) {
  const auto node =
      [&place](const calibration::Key& key) -> std::pair<const toml::table*, std::string> {
    const auto [part, name] = table_and_key(key.recorded);
    return {part.empty() ? &place.table : place.find(part.c_str()), name};
  };
  return {calibration::Format::recorded, place.find("lens") != nullptr,
          [node](const calibration::Key& key) -> std::optional<Value> {
            const auto [table, name] = node(key);
            const toml::node* found = table ? table->get(name) : nullptr;
            return found ? std::optional(value_of(*found)) : std::nullopt;
          },
          [node, &place](const calibration::Key& key, std::optional<Position> at,
                         const std::string& what) {
            const auto [table, name] = node(key);
            const toml::table& home = table ? *table : place.table;
            const toml::node* found = home.get(name);
            if (!at) at = position((found ? *found : home).source());
            throw Error(place.file.string() + ":" + std::to_string(at->line) + ": " +
                        place.key(key.recorded) + ": " + what);
          }};
}

StreamFormat parse_stream(const Place& place) {
  StreamFormat stream;
  try {
    stream.format = pixel_format_from_string(place.text("format"));
  } catch (const std::invalid_argument& error) {
    place.fail("format", std::string("is not valid: ") + error.what());
  }
  if (place.table.contains("bayer")) {
    try {
      stream.bayer = bayer_pattern_from_string(place.text("bayer"));
    } catch (const std::invalid_argument& error) {
      place.fail("bayer", std::string("is not valid: ") + error.what());
    }
    if (stream.format != PixelFormat::gray8 && stream.format != PixelFormat::gray16)
      place.fail("bayer", std::string("conflicts with ") + to_string(stream.format));
  }
  if (place.table.contains("codec")) {
    const std::string codec = place.text("codec");
    if (codec != "ffv1" && codec != "raw")
      place.fail("codec", "is \"" + codec + "\"; this previzd reads: ffv1, raw");
    if (codec == "raw") stream.codec = VideoCodec::raw;
  }
  stream.width = place.pixels("width");
  stream.height = place.pixels("height");
  if (place.table.contains("frames")) {
    const auto frames = place.get<std::int64_t>("frames", "a count");
    if (frames < 0) place.fail("frames", "must not be negative");
    stream.frames = static_cast<std::uint64_t>(frames);
  }
  return stream;
}

Losses parse_losses(const Place& place) {
  Losses lost;
  for (const auto& [key, count] : loss_keys) {
    if (!place.table.contains(key)) continue;
    const auto value = place.get<std::int64_t>(key, "a count");
    if (value < 0) place.fail(key, "must not be negative");
    lost.*count = static_cast<std::uint64_t>(value);
  }
  return lost;
}

std::vector<MissingAsset> parse_missing(const Place& place) {
  std::vector<MissingAsset> missing;
  for (const auto& [key, value] : place.table) {
    const std::string as_written(key.str());
    const Place asset = place.inner(as_written.c_str());
    missing.push_back({as_written, asset.text("file"),
                       asset.table.contains("sha256") ? asset.text("sha256") : "",
                       asset.text("why")});
  }
  return missing;
}

TakeInfo parse_take(const Place& place) {
  TakeInfo take;
  const auto number = place.get<std::int64_t>("number", "a whole number");
  if (number < 0 || number > 1'000'000) place.fail("number", "must be between 0 and 1000000");
  take.number = static_cast<int>(number);
  take.slate = place.text("slate");
  take.timecode = place.text("timecode");
  take.timecode_fps = place.number("timecode_fps");
  take.notes = place.text("notes");
  take.good = place.get<bool>("good", "true or false");
  return take;
}

Timecode parse_timecode(const Place& place) {
  return {place.text("first"), place.number("fps")};
}

void parse_set(const Place& place, SessionInfo& info) {
  info.set_name = place.text("name");
  if (!place.table.contains("text_base64")) {
    info.set_text = place.text("text");
    return;
  }
  try {
    info.set_text = from_base64(place.text("text_base64"));
  } catch (const std::invalid_argument&) {
    place.fail("text_base64", "must be base64");
  }
}

}  // namespace

std::string to_toml(const SessionFile& file) {
  std::string text = "# A recorded session: what the devices of a take said.\n";
  const bool is_ffv1 = std::ranges::all_of(
      file.streams, [](const auto& stream) { return stream.second.codec == VideoCodec::ffv1; });
  text += line("format_version", is_ffv1 ? first_format_version : format_version);
  text += "name = " + quote(file.info.name) + "\nclock = " + quote(file.info.clock) + "\n";
  text += std::string("closed = ") + (file.closed ? "true" : "false") +
          "  # false: still recording, or the recording was cut off\n";
  if (!file.fault.empty()) text += "fault = " + quote(file.fault) + "\n";
  text += losses_toml(file.lost);
  for (const auto& [source, stream] : file.streams) text += stream_toml(source, stream);
  if (file.info.observer) text += observer_toml(*file.info.observer);
  if (file.info.light) text += light_toml(*file.info.light);
  if (file.info.take) text += take_toml(*file.info.take);
  if (file.info.timecode) text += timecode_toml(*file.info.timecode);
  text += "\n[assets]  # as the set writes them = where they are below this directory\n";
  for (const auto& [as_written, path] : file.info.assets)
    text += quote(as_written) + " = " + quote(path) + "\n";
  text += missing_toml(file.info.missing_assets);
  text += "\n[set]\nname = " + quote(file.info.set_name) + "\n";
  text += text_assignment(file.info.set_text);
  try {
    static_cast<void>(toml::parse(text));
  } catch (const toml::parse_error& error) {
    throw Error("a session's name, clock, set name and asset paths must be UTF-8: " +
                std::string(error.description()));
  }
  return text;
}

SessionFile parse_session_toml(const std::string& text, const std::filesystem::path& path) {
  const box::Reading reading(path);
  toml::table root;
  try {
    root = toml::parse(text, path.string());
  } catch (const toml::parse_error& error) {
    throw Error(path.string() + ":" + std::to_string(error.source().begin.line) + ": " +
                std::string(error.description()));
  }
  const Place top{path, root, ""};
  const auto version = top.get<std::int64_t>("format_version", "a whole number");
  if (version < first_format_version || version > format_version)
    top.fail("format_version", "is " + std::to_string(version) + "; this previzd reads " +
                                   std::to_string(first_format_version) + " to " +
                                   std::to_string(format_version));
  SessionFile file;
  file.info.name = top.text("name");
  file.info.clock = top.text("clock");
  file.closed = top.get<bool>("closed", "true or false");
  if (root.contains("fault")) file.fault = top.text("fault");
  file.lost = parse_losses(top);
  for (const char* source : {"observer", "light", "composite"}) {
    if (!top.find(source)) continue;
    const Place place = top.inner(source);
    if (place.find("video")) file.streams[source] = parse_stream(place.inner("video"));
    if (source == std::string_view("composite") || !place.find("calibration")) continue;
    if (source == std::string_view("observer"))
      file.info.observer = read_observer(calibration_source(place.inner("calibration")));
    else
      file.info.light = read_light_camera(calibration_source(place.inner("calibration")));
  }
  for (const auto& [key, value] : top.inner("assets").table) {
    if (!value.is_string())
      top.inner("assets").fail(std::string(key.str()).c_str(), "must be a path");
    file.info.assets[std::string(key.str())] = value.value_or<std::string>("");
  }
  if (top.find("missing_assets"))
    file.info.missing_assets = parse_missing(top.inner("missing_assets"));
  if (top.find("take")) file.info.take = parse_take(top.inner("take"));
  if (top.find("timecode")) file.info.timecode = parse_timecode(top.inner("timecode"));
  parse_set(top.inner("set"), file.info);
  return file;
}

SessionFile read_session_toml(const std::filesystem::path& file) {
  constexpr FileKind kind{"a session.toml", 1 << 24};  // with the text of a set
  return parse_session_toml(read_plain_file(file, kind), file);
}

}  // namespace previz::session
