#include "tests/truth/truth_set.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <glm/gtc/matrix_transform.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "daemon/core/lighting/exr_picture.hpp"
#include "daemon/core/lighting/response.hpp"
#include "daemon/core/output/png.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::truth {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// A value of set.json that knows where it stands, so that every complaint names file and key.
class Node {
 public:
  Node(const json& value, std::string where) : value_(value), where_(std::move(where)) {}

  bool has(const char* key) const {
    return value_.is_object() && value_.contains(key) && !value_.at(key).is_null();
  }
  Node operator[](const char* key) const {
    if (!has(key)) fail(std::string("has no '") + key + "'");
    return {value_.at(key), where_ + "." + key};
  }
  std::vector<Node> list() const {
    if (!value_.is_array()) fail("must be a list");
    std::vector<Node> out;
    for (std::size_t i = 0; i < value_.size(); ++i) {
      out.emplace_back(value_[i], where_ + "[" + std::to_string(i) + "]");
    }
    return out;
  }
  std::map<std::string, Node> members() const {
    if (!value_.is_object()) fail("must be an object");
    std::map<std::string, Node> out;
    for (const auto& [key, value] : value_.items())
      out.emplace(key, Node(value, where_ + "." + key));
    return out;
  }
  double number() const {
    if (!value_.is_number()) fail("must be a number");
    return value_.get<double>();
  }
  double number_above_zero() const {
    const double value = number();
    if (!(value > 0)) fail("must be above 0");
    return value;
  }
  int integer() const {
    if (!value_.is_number_integer()) fail("must be a whole number");
    return value_.get<int>();
  }
  std::string text() const {
    if (!value_.is_string()) fail("must be a text");
    return value_.get<std::string>();
  }
  double number_or(const char* key, double otherwise) const {
    return has(key) ? (*this)[key].number() : otherwise;
  }
  // Row-major 4x4, rigid.
  glm::dmat4 pose() const {
    glm::dmat4 m(1);
    const auto rows = list();
    if (rows.size() != 4) fail("must be 4 rows of 4 numbers");
    for (int r = 0; r < 4; ++r) {
      const auto row = rows[static_cast<std::size_t>(r)].list();
      if (row.size() != 4) fail("must be 4 rows of 4 numbers");
      for (int c = 0; c < 4; ++c) m[c][r] = row[static_cast<std::size_t>(c)].number();
    }
    return m;
  }
  glm::dvec3 vector() const {
    const auto v = list();
    if (v.size() != 3) fail("must be 3 numbers");
    return {v[0].number(), v[1].number(), v[2].number()};
  }
  [[noreturn]] void fail(const std::string& what) const { throw Error(where_ + ": " + what); }

 private:
  const json& value_;
  std::string where_;
};

// set.json says the curve in words: "... sRGB_OETF(clip(signal)) ...", "linear", "gamma 2.2".
ResponseCurve parse_response(const Node& node) {
  const std::string words = node.text();
  ResponseCurve curve;
  if (words.find("sRGB") != std::string::npos) return curve;
  const auto gamma = words.find("gamma");
  const auto power = words.find("^(1/");
  if (gamma != std::string::npos || power != std::string::npos) {
    curve.kind = ResponseCurve::Kind::gamma;
    const std::string rest =
        power != std::string::npos ? words.substr(power + 4) : words.substr(gamma + 5);
    const auto digit = rest.find_first_of("0123456789");
    if (digit == std::string::npos) node.fail("names a gamma without its number");
    curve.gamma = std::stod(rest.substr(digit));
    return curve;
  }
  if (words.find("linear") != std::string::npos || words.find("(clip(signal)") == 0) {
    curve.kind = ResponseCurve::Kind::linear;
    return curve;
  }
  node.fail("'" + words + "' is not understood; sRGB_OETF, gamma N, ^(1/N) and linear are");
}

std::optional<ThinLens> parse_lens(const Node& observer) {
  if (!observer.has("lens")) return std::nullopt;
  const Node lens = observer["lens"];
  ThinLens out;
  out.focal_length_m = lens["focal_length_mm"].number_above_zero() / 1000;
  out.f_number = lens.has("f_number")
                     ? lens["f_number"].number_above_zero()
                     : out.focal_length_m / lens["aperture_diameter_m"].number_above_zero();
  out.focus_distance_m = lens["focus_distance_m"].number_above_zero();
  return out;
}

ObserverCalibration parse_observer(const Node& observer) {
  ObserverCalibration out;
  PinholeIntrinsics& k = out.intrinsics;
  k.width = observer["width"].integer();
  k.height = observer["height"].integer();
  const auto rows = observer["K"].list();
  if (rows.size() != 3 || rows[0].list().size() != 3 || rows[1].list().size() != 3) {
    observer["K"].fail("must be 3 rows of 3 numbers");
  }
  k.fx = rows[0].list()[0].number();
  k.cx = rows[0].list()[2].number();
  k.fy = rows[1].list()[1].number();
  k.cy = rows[1].list()[2].number();
  if (observer.has("distortion")) {
    const Node d = observer["distortion"];
    k.k1 = d.number_or("k1", 0);
    k.k2 = d.number_or("k2", 0);
    k.p1 = d.number_or("p1", 0);
    k.p2 = d.number_or("p2", 0);
    k.k3 = d.number_or("k3", 0);
    k.k4 = d.number_or("k4", 0);
    k.k5 = d.number_or("k5", 0);
    k.k6 = d.number_or("k6", 0);
  }
  if (observer.has("vignetting")) observer["vignetting"].fail("vignetting is not supported");
  out.lens = parse_lens(observer);
  out.response = parse_response(observer["response"]);
  return out;
}

// From the four corners as printed: lower left, lower right, upper right, upper left.
set::Tag parse_tag(const Node& node) {
  set::Tag tag;
  tag.id = node["id"].integer();
  tag.size_m = node["size_m"].number_above_zero();
  const auto corners = node["corners_world"].list();
  if (corners.size() != 4) node["corners_world"].fail("must be 4 corners");
  glm::dvec3 corner[4];
  glm::dvec3 centre(0);
  for (std::size_t i = 0; i < 4; ++i) {
    corner[i] = corners[i].vector();
    centre += corner[i] / 4.0;
  }
  const glm::dvec3 x = glm::normalize(corner[1] - corner[0]);
  const glm::dvec3 z = glm::normalize(glm::cross(x, corner[3] - corner[0]));
  tag.world_from_tag = glm::dmat4(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0),
                                  glm::dvec4(z, 0), glm::dvec4(centre, 1));
  return tag;
}

LightCameraCalibration parse_light_camera(const Node& node, const ResponseCurve& observer_curve) {
  LightCameraCalibration out;
  FisheyeIntrinsics& k = out.intrinsics;
  k.width = node["width"].integer();
  k.height = node["height"].integer();
  k.fx = node["fx"].number_above_zero();
  k.fy = node["fy"].number_above_zero();
  k.cx = node["cx"].number();
  k.cy = node["cy"].number();
  k.k = {node.number_or("k1", 0), node.number_or("k2", 0), node.number_or("k3", 0),
         node.number_or("k4", 0)};
  k.max_angle_rad = node["fov_deg"].number_above_zero() / 2 * std::numbers::pi / 180;
  const bool as_observer =
      !node.has("response") || node["response"].text().find("as observer") != std::string::npos;
  const double clip_share = out.response.clip_share;
  out.response = as_observer ? observer_curve : parse_response(node["response"]);
  out.response.clip_share = clip_share;  // the light camera's own
  out.world_from_camera = node["world_from_camera"].pose();
  return out;
}

// A CSV with a header line; every row as header -> field.
std::vector<std::map<std::string, std::string>> read_csv(const fs::path& file) {
  std::ifstream in(file);
  if (!in) throw Error(file.string() + ": cannot be read");
  const auto split = [](std::string line) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    std::vector<std::string> fields;
    std::stringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');) fields.push_back(field);
    return fields;
  };
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> header = split(line);
  std::vector<std::map<std::string, std::string>> rows;
  for (int number = 2; std::getline(in, line); ++number) {
    if (line.empty()) continue;
    const std::vector<std::string> fields = split(line);
    if (fields.size() < header.size()) {
      throw Error(file.string() + ":" + std::to_string(number) + ": has " +
                  std::to_string(fields.size()) + " fields where the header names " +
                  std::to_string(header.size()));
    }
    auto& row = rows.emplace_back();
    for (std::size_t i = 0; i < header.size(); ++i) row[header[i]] = fields[i];
  }
  return rows;
}

template <class T>
T field(const std::map<std::string, std::string>& row, const char* name, const fs::path& file) {
  const auto found = row.find(name);
  if (found == row.end()) throw Error(file.string() + ": has no column '" + name + "'");
  if constexpr (std::is_same_v<T, std::string>) {
    return found->second;
  } else {
    std::istringstream stream(found->second);
    T value{};
    if (!(stream >> value)) {
      throw Error(file.string() + ": '" + found->second + "' in column '" + name +
                  "' is not a number");
    }
    return value;
  }
}

void load_observer_frames(const Node& observer, TruthSet& set) {
  const fs::path csv = set.directory / (observer.has("timestamps") ? observer["timestamps"].text()
                                                                   : "observer/timestamps.csv");
  const auto poses = observer["poses_world_from_camera"].members();
  for (const auto& row : read_csv(csv)) {
    ObserverFrame frame;
    frame.index = field<int>(row, "frame", csv);
    frame.file = csv.parent_path() / field<std::string>(row, "file", csv);
    frame.timestamp_ns = field<std::int64_t>(row, "timestamp_ns", csv);
    if (!fs::exists(frame.file)) {
      set.notes.push_back(frame.file.string() + " is not there");
      continue;
    }
    const auto pose = poses.find(frame_name(frame.index));
    if (pose == poses.end()) {
      observer["poses_world_from_camera"].fail("has no '" + frame_name(frame.index) + "'");
    }
    frame.world_from_camera = pose->second.pose();
    set.frames.push_back(frame);
  }
  std::sort(set.frames.begin(), set.frames.end(),
            [](const auto& a, const auto& b) { return a.timestamp_ns < b.timestamp_ns; });
}

// The frames of a set that has poses alone.
void list_poses(const Node& observer, TruthSet& set) {
  set.has_pictures = false;
  for (const auto& [name, pose] : observer["poses_world_from_camera"].members()) {
    ObserverFrame& frame = set.frames.emplace_back();
    std::from_chars(name.data(), name.data() + name.size(), frame.index);
    if (name != frame_name(frame.index)) pose.fail("is not of a frame, whose names are as '0000'");
    frame.world_from_camera = pose.pose();
    set.truth_frames.push_back(frame.index);
  }
}

void load_light_frames(TruthSet& set) {
  const fs::path csv = set.directory / "light" / "light.csv";
  if (!fs::exists(csv)) {
    set.notes.push_back(csv.string() + " is not there");
    return;
  }
  for (const auto& row : read_csv(csv)) {
    LightFrame frame;
    frame.file = csv.parent_path() / field<std::string>(row, "file", csv);
    frame.timestamp_ns = field<std::int64_t>(row, "timestamp_ns", csv);
    frame.exposure = field<double>(row, "exposure", csv);
    // A sequence shows other light than the truth pictures have.
    const bool sequence = row.contains("kind") && row.at("kind") == "sequence";
    if (sequence) continue;
    if (!fs::exists(frame.file)) {
      set.notes.push_back(frame.file.string() + " is not there");
      continue;
    }
    set.light_frames.push_back(frame);
  }
  std::sort(set.light_frames.begin(), set.light_frames.end(),
            [](const auto& a, const auto& b) { return a.timestamp_ns < b.timestamp_ns; });
}

fs::path truth_file(const TruthSet& set, int frame, const char* what) {
  return set.directory / "truth" / (frame_name(frame) + "_" + what + ".exr");
}

void load_truth_list(const Node& truth, TruthSet& set) {
  for (const Node& node : truth["frames"].list()) {
    const int frame = node.integer();
    const bool pictured = std::any_of(set.frames.begin(), set.frames.end(),
                                      [&](const auto& f) { return f.index == frame; });
    if (!pictured || !fs::exists(truth_file(set, frame, "mixed"))) {
      set.notes.push_back("truth frame " + std::to_string(frame) + " is left out: " +
                          (pictured ? "no truth picture" : "no observer picture"));
      continue;
    }
    set.truth_frames.push_back(frame);
    const std::string key = std::to_string(frame);
    if (!truth.has("statistics") || !truth["statistics"].has(key.c_str())) continue;
    const Node statistics = truth["statistics"][key.c_str()];
    TruthStatistics& out = set.statistics[frame];
    if (statistics.has("diff_rmse_abs")) out.diff_rmse = statistics["diff_rmse_abs"].number();
    if (statistics.has("mixed_clipped_rmse_rel_of_mean")) {
      out.mixed_rmse_of_mean = statistics["mixed_clipped_rmse_rel_of_mean"].number();
    }
  }
}

std::vector<RelitLamp> parse_relit(const Node& relit) {
  std::vector<RelitLamp> lamps;
  for (const Node& node : relit["lamps"].list()) {
    RelitLamp& lamp = lamps.emplace_back();
    lamp.direction = glm::normalize(node["direction_world"].vector());
    lamp.radius_rad = node["radius_deg"].number_above_zero() * std::numbers::pi / 180;
    lamp.gain_mixed = node["gain_mixed"].vector();
  }
  return lamps;
}

std::vector<set::Light> parse_lamps(const Node& lamps) {
  std::vector<set::Light> lights;
  for (const Node& node : lamps.list()) {
    set::Light& light = lights.emplace_back();
    light.name = "lamp " + std::to_string(lights.size());
    light.type = set::LightType::sphere;
    light.position = node["position"].vector();
    light.radius_m = node["radius_m"].number_above_zero();
    light.emission = node["radiance"].vector();
    light.gain_real = 1;
  }
  return lights;
}

}  // namespace

std::string frame_name(int frame) {
  char name[16];
  std::snprintf(name, sizeof name, "%04d", frame);
  return name;
}

TruthSet load_truth_set(const fs::path& directory) {
  const fs::path file = directory / "set.json";
  std::ifstream in(file);
  if (!in) throw Error(file.string() + ": cannot be read; a ground truth set has one");
  json parsed;
  try {
    parsed = json::parse(in);
  } catch (const json::exception& e) {
    throw Error(file.string() + ": " + e.what());
  }
  const Node root(parsed, file.string() + ": set");
  TruthSet set;
  set.directory = directory;
  set.name = root.has("name") ? root["name"].text() : directory.filename().string();
  const Node observer = root["observer"];
  set.observer = parse_observer(observer);
  set.exposure = observer["exposure"].number_above_zero();
  if (root.has("truth"))
    load_observer_frames(observer, set);
  else
    list_poses(observer, set);
  if (root.has("tags")) {
    const Node tags = root["tags"];
    set.tag_family = tags["family"].text();
    for (const Node& tag : tags["list"].list()) set.tags.push_back(parse_tag(tag));
  }
  if (root.has("light_camera")) {
    set.light_camera = parse_light_camera(root["light_camera"], set.observer.response);
    load_light_frames(set);
  }
  set.environment = directory / root["env"]["file"].text();
  set.phantom = directory / root["gltf"]["phantom"].text();
  set.virtual_objects = directory / root["gltf"]["virtual"].text();
  if (root.has("relit")) set.relit = parse_relit(root["relit"]);
  if (root.has("lamps")) set.lamps = parse_lamps(root["lamps"]);
  if (root.has("truth")) load_truth_list(root["truth"], set);
  if (set.truth_frames.empty())
    throw Error(file.string() + ": no frame has both truth and picture");
  return set;
}

void expose_longer(TruthSet& set, double times, const fs::path& directory) {
  fs::create_directories(directory);
  set.exposure *= times;
  for (ObserverFrame& frame : set.frames) {
    Plate plate = output::read_png(frame.file);
    const lighting::Response response(set.observer.response, plate.bits);
    for (std::uint16_t& code : plate.samples)
      code = response.forward(times * response.inverse()[code]);
    frame.file = directory / frame.file.filename();
    output::write_png(frame.file, plate);
  }
}

set::Set set_of(const TruthSet& truth) {
  set::Set set;
  const auto add = [&](const char* name, const fs::path& file, set::Presence presence) {
    set::Object& object = set.objects.emplace_back();
    object.name = name;
    object.file = file;
    object.file_as_written = file.string();
    object.presence = presence;
  };
  add("phantom", truth.phantom, set::Presence::phantom);
  add("virtual", truth.virtual_objects, set::Presence::virtual_object);
  set.lights = truth.lamps;
  set.lighting.environment = truth.environment;
  set.lighting.environment_as_written = truth.environment.string();
  return set;
}

const ObserverFrame& observer_frame(const TruthSet& set, int frame) {
  const auto found = std::find_if(set.frames.begin(), set.frames.end(),
                                  [&](const auto& f) { return f.index == frame; });
  if (found == set.frames.end()) {
    throw Error(set.name + ": has no observer frame " + std::to_string(frame));
  }
  return *found;
}

TruthFrame load_truth_frame(const TruthSet& set, int frame) {
  TruthFrame out;
  out.width = set.observer.intrinsics.width;
  out.height = set.observer.intrinsics.height;
  out.exposure = set.exposure;
  out.response = set.observer.response;
  const auto read = [&](const char* what) {
    const fs::path file = truth_file(set, frame, what);
    std::vector<std::string> notes;
    const lighting::LinearPicture picture = lighting::read_exr_picture(file, notes);
    if (picture.width != out.width || picture.height != out.height) {
      throw Error(file.string() + ": is not " + std::to_string(out.width) + "x" +
                  std::to_string(out.height));
    }
    return render::Sheet<glm::vec3>(picture.radiance.begin(), picture.radiance.end());
  };
  out.real = read("real");
  out.mixed = read("mixed");
  for (const glm::vec3& m : read("mask")) out.mask.push_back(m.x);

  const fs::path file = observer_frame(set, frame).file;
  const Plate plate = output::read_png(file);
  if (plate.width != out.width || plate.height != out.height) {
    throw Error(file.string() + ": is not " + std::to_string(out.width) + "x" +
                std::to_string(out.height));
  }
  const lighting::Response response(out.response, plate.bits);
  for (std::size_t i = 0; i < plate.samples.size(); i += 3) {
    const auto linear = [&](std::size_t c) {
      return static_cast<float>(response.inverse()[plate.samples[i + c]] / out.exposure);
    };
    out.plate.emplace_back(linear(0), linear(1), linear(2));
  }
  const auto statistics = set.statistics.find(frame);
  if (statistics != set.statistics.end()) {
    out.diff_rmse = statistics->second.diff_rmse;
    out.mixed_rmse_of_mean = statistics->second.mixed_rmse_of_mean;
  }
  return out;
}

}  // namespace previz::truth
