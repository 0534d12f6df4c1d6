#include "drivers/session/session_toml.hpp"

#include <openssl/evp.h>

#include <toml++/toml.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "drivers/error.hpp"

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

std::string base64(const std::string& bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3), '\0');
  EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                  reinterpret_cast<const unsigned char*>(bytes.data()),
                  static_cast<int>(bytes.size()));
  return text;
}

std::string from_base64(const std::string& text) {
  std::string bytes(text.size() / 4 * 3, '\0');
  const int size = EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()),
                                   reinterpret_cast<const unsigned char*>(text.data()),
                                   static_cast<int>(text.size()));
  if (size < 0) throw std::invalid_argument("not base64");
  // EVP_DecodeBlock counts the bytes that the padding stands for.
  std::size_t padding = 0;
  while (padding < 2 && padding < text.size() && text[text.size() - 1 - padding] == '=') ++padding;
  bytes.resize(static_cast<std::size_t>(size) - padding);
  return bytes;
}

bool reads_back(const std::string& assignment, const std::string& text) {
  try {
    return toml::parse(assignment)["text"].value<std::string>() == text;
  } catch (const toml::parse_error&) {
    return false;
  }
}

// A set's text as a reader likes it best among the forms that bring it back byte for byte.
std::string text_assignment(const std::string& text) {
  std::string literal = "text = '''\n" + text + "'''\n";
  if (reads_back(literal, text)) return literal;
  std::string escaped = "text = " + quote(text) + "\n";
  if (reads_back(escaped, text)) return escaped;
  return "text_base64 = \"" + base64(text) + "\"  # the set file is not UTF-8\n";
}

const char* to_string(ResponseCurve::Kind kind) {
  switch (kind) {
    case ResponseCurve::Kind::srgb:
      return "srgb";
    case ResponseCurve::Kind::linear:
      return "linear";
    case ResponseCurve::Kind::gamma:
      return "gamma";
    case ResponseCurve::Kind::table:
      return "table";
  }
  throw std::invalid_argument("unknown response curve");
}

std::string response_toml(const ResponseCurve& response, const std::string& table) {
  std::string text = "\n[" + table + "]\nkind = \"" + to_string(response.kind) + "\"\n";
  if (response.kind == ResponseCurve::Kind::gamma)
    text += "gamma = " + to_text(response.gamma) + "\n";
  if (response.kind == ResponseCurve::Kind::table)
    text += "inverse_table = " + to_list(response.inverse_table) + "\n";
  return text;
}

std::string line(const char* key, double value) {
  return std::string(key) + " = " + to_text(value) + "\n";
}

std::string line(const char* key, int value) {
  return std::string(key) + " = " + std::to_string(value) + "\n";
}

std::string observer_toml(const ObserverCalibration& calibration) {
  const PinholeIntrinsics& lens = calibration.intrinsics;
  std::string text = "\n[observer.calibration]  # pixels; Brown-Conrady in OpenCV's order\n";
  text += line("width", lens.width) + line("height", lens.height);
  text += line("fx", lens.fx) + line("fy", lens.fy) + line("cx", lens.cx) + line("cy", lens.cy);
  text += line("k1", lens.k1) + line("k2", lens.k2) + line("p1", lens.p1) + line("p2", lens.p2) +
          line("k3", lens.k3);
  text += line("responsivity", calibration.responsivity);
  text += response_toml(calibration.response, "observer.calibration.response");
  if (calibration.lens)
    text += "\n[observer.calibration.lens]\n" +
            line("focal_length_m", calibration.lens->focal_length_m) +
            line("f_number", calibration.lens->f_number) +
            line("focus_distance_m", calibration.lens->focus_distance_m);
  return text;
}

std::string light_toml(const LightCameraCalibration& calibration) {
  const FisheyeIntrinsics& lens = calibration.intrinsics;
  std::array<double, 16> rows{};
  for (int i = 0; i < 16; ++i) rows[i] = calibration.world_from_camera[i % 4][i / 4];
  std::string text = "\n[light.calibration]  # pixels; Kannala-Brandt\n";
  text += line("width", lens.width) + line("height", lens.height);
  text += line("fx", lens.fx) + line("fy", lens.fy) + line("cx", lens.cx) + line("cy", lens.cy);
  text += "k = " + to_list(lens.k) + "\n" + line("max_angle_rad", lens.max_angle_rad);
  text += "world_from_camera = " + to_list(rows) + "  # row-major, metres\n";
  text += line("responsivity", calibration.responsivity);
  const glm::dvec3& dark = calibration.dark_level;
  text += "vignetting = " + to_list(calibration.vignetting) + "\n";
  text += "dark_level = " + to_list(std::array{dark.x, dark.y, dark.z}) + "\n";
  return text + response_toml(calibration.response, "light.calibration.response");
}

std::string stream_toml(const std::string& source, const StreamFormat& stream) {
  std::string text = "\n[" + source + ".video]\nformat = " + quote(to_string(stream.format)) + "\n";
  text += line("width", stream.width) + line("height", stream.height);
  if (stream.bayer != BayerPattern::none)
    text += "bayer = " + quote(to_string(stream.bayer)) + "\n";
  if (stream.frames) text += "frames = " + std::to_string(*stream.frames) + "\n";
  return text;
}

std::string take_toml(const TakeInfo& take) {
  return "\n[take]  # as on the board\n" + line("number", take.number) +
         "slate = " + quote(take.slate) + "\ntimecode = " + quote(take.timecode) +
         "  # of the first observer frame, time of day\n" +
         line("timecode_fps", take.timecode_fps) + "notes = " + quote(take.notes) +
         "\ngood = " + (take.good ? "true" : "false") + "\n";
}

// ---- reading

// Where a value is looked for, so that an error can name it.
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

  template <typename Value>
  Value get(const char* k, const char* allowed) const {
    const auto value = table[k].value<Value>();
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
  std::vector<double> numbers(const char* k, std::size_t count) const {
    const toml::array* list = table[k].as_array();
    std::vector<double> values;
    if (list)
      for (const toml::node& item : *list)
        if (const auto value = item.value<double>()) values.push_back(*value);
    if (!list || values.size() != list->size() || (count && values.size() != count))
      fail(k, count ? "must be a list of " + std::to_string(count) + " numbers"
                    : "must be a list of numbers");
    return values;
  }
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

ResponseCurve parse_response(const Place& place) {
  ResponseCurve response;
  const std::string kind = place.text("kind");
  if (kind == "srgb") {
    response.kind = ResponseCurve::Kind::srgb;
  } else if (kind == "linear") {
    response.kind = ResponseCurve::Kind::linear;
  } else if (kind == "gamma") {
    response.kind = ResponseCurve::Kind::gamma;
    response.gamma = place.number("gamma");
  } else if (kind == "table") {
    response.kind = ResponseCurve::Kind::table;
    response.inverse_table = place.numbers("inverse_table", 0);
  } else {
    place.fail("kind", "must be \"srgb\", \"linear\", \"gamma\" or \"table\"");
  }
  return response;
}

// What no lens can be would become rays that are no direction.
ThinLens parse_lens(const Place& place) {
  const ThinLens lens{place.number("focal_length_m"), place.number("f_number"),
                      place.number("focus_distance_m")};
  if (!(lens.focal_length_m > 0 && std::isfinite(lens.focal_length_m)))
    place.fail("focal_length_m", "must be above 0");
  if (!(lens.f_number >= 0.5 && std::isfinite(lens.f_number)))
    place.fail("f_number", "must be at least 0.5");
  if (!(lens.focus_distance_m > lens.focal_length_m && lens.focus_distance_m <= 1e9))
    place.fail("focus_distance_m", "must be more than the focal length and at most 1e9");
  return lens;
}

ObserverCalibration parse_observer(const Place& place) {
  ObserverCalibration calibration;
  calibration.intrinsics = {place.pixels("width"), place.pixels("height"), place.number("fx"),
                            place.number("fy"),    place.number("cx"),     place.number("cy"),
                            place.number("k1"),    place.number("k2"),     place.number("p1"),
                            place.number("p2"),    place.number("k3")};
  calibration.responsivity = place.number("responsivity");
  calibration.response = parse_response(place.inner("response"));
  if (place.find("lens")) calibration.lens = parse_lens(place.inner("lens"));
  return calibration;
}

// Sessions of before these were known lack them: a lens and a sensor without fault.
void parse_shading(const Place& place, LightCameraCalibration& calibration) {
  if (place.table.contains("vignetting")) {
    const std::vector<double> v = place.numbers("vignetting", 3);
    std::copy(v.begin(), v.end(), calibration.vignetting.begin());
    if (!(least_illumination(calibration.vignetting, calibration.intrinsics.max_angle_rad) >=
          min_illumination))
      place.fail("vignetting", "must leave at least 0.01 of the light up to max_angle_rad");
  }
  if (place.table.contains("dark_level")) {
    const std::vector<double> dark = place.numbers("dark_level", 3);
    for (const double level : dark)
      if (!(level >= 0 && level <= max_dark_level))
        place.fail("dark_level", "must be between 0 and 0.5");
    calibration.dark_level = {dark[0], dark[1], dark[2]};
  }
}

LightCameraCalibration parse_light(const Place& place) {
  LightCameraCalibration calibration;
  FisheyeIntrinsics& lens = calibration.intrinsics;
  lens.width = place.pixels("width");
  lens.height = place.pixels("height");
  lens.fx = place.number("fx");
  lens.fy = place.number("fy");
  lens.cx = place.number("cx");
  lens.cy = place.number("cy");
  const std::vector<double> k = place.numbers("k", 4),
                            rows = place.numbers("world_from_camera", 16);
  std::copy(k.begin(), k.end(), lens.k.begin());
  lens.max_angle_rad = place.number("max_angle_rad");
  for (int i = 0; i < 16; ++i) calibration.world_from_camera[i % 4][i / 4] = rows[i];
  calibration.responsivity = place.number("responsivity");
  calibration.response = parse_response(place.inner("response"));
  parse_shading(place, calibration);
  return calibration;
}

StreamFormat parse_stream(const Place& place) {
  StreamFormat stream;
  try {
    stream.format = pixel_format_from_string(place.text("format"));
  } catch (const std::invalid_argument& error) {
    place.fail("format", std::string("is not understood: ") + error.what());
  }
  if (place.table.contains("bayer")) {
    try {
      stream.bayer = bayer_pattern_from_string(place.text("bayer"));
    } catch (const std::invalid_argument& error) {
      place.fail("bayer", std::string("is not understood: ") + error.what());
    }
    if (stream.format != PixelFormat::gray8 && stream.format != PixelFormat::gray16)
      place.fail("bayer", std::string("does not go with ") + to_string(stream.format));
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
  text += line("format_version", format_version);
  text += "name = " + quote(file.info.name) + "\nclock = " + quote(file.info.clock) + "\n";
  text += std::string("closed = ") + (file.closed ? "true" : "false") +
          "  # false: still recording, or the recording was cut off\n";
  for (const auto& [source, stream] : file.streams) text += stream_toml(source, stream);
  if (file.info.observer) text += observer_toml(*file.info.observer);
  if (file.info.light) text += light_toml(*file.info.light);
  if (file.info.take) text += take_toml(*file.info.take);
  text += "\n[assets]  # as the set writes them = where they are below this directory\n";
  for (const auto& [as_written, path] : file.info.assets)
    text += quote(as_written) + " = " + quote(path) + "\n";
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
  toml::table root;
  try {
    root = toml::parse(text, path.string());
  } catch (const toml::parse_error& error) {
    throw Error(path.string() + ":" + std::to_string(error.source().begin.line) + ": " +
                std::string(error.description()));
  }
  const Place top{path, root, ""};
  const auto version = top.get<std::int64_t>("format_version", "a whole number");
  if (version != format_version)
    top.fail("format_version", "is " + std::to_string(version) + "; this previzd reads " +
                                   std::to_string(format_version));
  SessionFile file;
  file.info.name = top.text("name");
  file.info.clock = top.text("clock");
  file.closed = top.get<bool>("closed", "true or false");
  for (const char* source : {"observer", "light", "composite"}) {
    if (!top.find(source)) continue;
    const Place place = top.inner(source);
    if (place.find("video")) file.streams[source] = parse_stream(place.inner("video"));
    if (source == std::string_view("composite") || !place.find("calibration")) continue;
    if (source == std::string_view("observer"))
      file.info.observer = parse_observer(place.inner("calibration"));
    else
      file.info.light = parse_light(place.inner("calibration"));
  }
  for (const auto& [key, value] : top.inner("assets").table) {
    if (!value.is_string())
      top.inner("assets").fail(std::string(key.str()).c_str(), "must be a path");
    file.info.assets[std::string(key.str())] = value.value_or<std::string>("");
  }
  if (top.find("take")) file.info.take = parse_take(top.inner("take"));
  parse_set(top.inner("set"), file.info);
  return file;
}

}  // namespace previz::session
