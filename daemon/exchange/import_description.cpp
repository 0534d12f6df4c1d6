#include "daemon/exchange/import_description.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "daemon/exchange/import_tables.hpp"
#include "daemon/exchange/json_members.hpp"
#include "daemon/set/pose.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

namespace fs = std::filesystem;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr Bounds any{-infinity, infinity};
constexpr Bounds positive{0, infinity, true};
constexpr std::int64_t latest_ns = std::numeric_limits<std::int64_t>::max();

// ---- calibration, spelled as in the set file

ResponseCurve read_response(const Members& m, double& responsivity) {
  ResponseCurve response;
  const std::string kind = m.has("kind") ? m.text("kind") : "srgb";
  if (kind == "gamma") {
    response.kind = ResponseCurve::Kind::gamma;
    response.gamma = m.number("gamma", {0.1, 10}, response.gamma);
  } else if (kind == "table") {
    response.kind = ResponseCurve::Kind::table;
    response.inverse_table = m.numbers("table", 0, {0, 1});
    const auto& table = response.inverse_table;
    const bool increases = std::ranges::adjacent_find(table, std::greater_equal{}) == table.end();
    if (table.size() < 2 || table.front() != 0 || table.back() != 1 || !increases)
      m.fail("table", "must increase strictly from 0 to 1");
  } else if (kind == "linear") {
    response.kind = ResponseCurve::Kind::linear;
  } else if (kind != "srgb") {
    m.fail("kind", "must be \"srgb\", \"linear\", \"gamma\" or \"table\"");
  }
  if (m.has("gamma") && kind != "gamma") m.fail("gamma", "belongs to kind \"gamma\" only");
  if (m.has("table") && kind != "table") m.fail("table", "belongs to kind \"table\" only");
  responsivity = m.number("responsivity", positive, 1.0);
  return response;
}

std::vector<std::string> response_members(std::vector<std::string> more = {}) {
  more.insert(more.end(), {"kind", "gamma", "table", "responsivity"});
  return more;
}

template <typename Intrinsics>
void read_common(const Members& m, Intrinsics& lens) {
  constexpr int largest_px = 16384;
  lens.width = static_cast<int>(m.integer("width", 2, largest_px));
  lens.height = static_cast<int>(m.integer("height", 2, largest_px));
  lens.fx = m.number("fx", positive);
  lens.fy = m.number("fy", positive);
  lens.cx = m.number("cx", any);
  lens.cy = m.number("cy", any);
}

glm::dmat4 read_rigid(const Members& m, const std::string& key) {
  const Json& rows = m.value(key);
  const std::string wanted = "must be 4 rows of 4 numbers, metres, the last row 0 0 0 1";
  if (!rows.is_array() || rows.size() != 4) m.fail(key, wanted);
  glm::dmat4 matrix{1.0};
  for (int row = 0; row < 4; ++row) {
    if (!rows[row].is_array() || rows[row].size() != 4) m.fail(key, wanted);
    for (int column = 0; column < 4; ++column) {
      if (!rows[row][column].is_number()) m.fail(key, wanted);
      matrix[column][row] = rows[row][column].get<double>();
    }
  }
  if (matrix[0][3] != 0 || matrix[1][3] != 0 || matrix[2][3] != 0 || matrix[3][3] != 1)
    m.fail(key, wanted);
  if (!(set::rigidity_error(matrix) <= set::rigid_tolerance))
    m.fail(key, "must be rigid: its upper 3x3 a rotation");
  return set::nearest_rigid(matrix);
}

glm::dmat4 read_pose(const Members& camera) {
  if (!camera.has("pose"))
    camera.fail("pose", "is missing; allowed: world_from_camera, or position_m and rotation_deg");
  const Members m = camera.object("pose", {"world_from_camera", "position_m", "rotation_deg"});
  if (m.has("world_from_camera")) {
    if (m.has("position_m") || m.has("rotation_deg"))
      m.fail("world_from_camera", "contradicts position_m and rotation_deg; one form is allowed");
    return read_rigid(m, "world_from_camera");
  }
  const auto position = m.numbers("position_m", 3, any);
  std::vector<double> turn(3, 0.0);
  if (m.has("rotation_deg")) turn = m.numbers("rotation_deg", 3, any);
  constexpr double degree = std::numbers::pi / 180;
  return set::pose({position[0], position[1], position[2]},
                   glm::dvec3(turn[0], turn[1], turn[2]) * degree);
}

void needs_intrinsics(const Members& camera, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (camera.has(key))
      camera.fail(key,
                  "needs intrinsics beside it; a calibration is given as a whole or not at all");
}

std::optional<ObserverCalibration> read_observer_calibration(const Members& camera) {
  if (!camera.has("intrinsics")) {
    needs_intrinsics(camera, {"lens", "response"});
    return std::nullopt;
  }
  const Members m = camera.object(
      "intrinsics", {"width", "height", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"});
  ObserverCalibration calibration;
  PinholeIntrinsics& lens = calibration.intrinsics;
  read_common(m, lens);
  lens.k1 = m.number("k1", any, 0);
  lens.k2 = m.number("k2", any, 0);
  lens.p1 = m.number("p1", any, 0);
  lens.p2 = m.number("p2", any, 0);
  lens.k3 = m.number("k3", any, 0);
  if (camera.has("lens")) {
    const Members thin = camera.object("lens", {"focal_length_mm", "f_number", "focus_distance_m"});
    calibration.lens = ThinLens{thin.number("focal_length_mm", {0, 1e4, true}) * 1e-3,
                                thin.number("f_number", {0.5, 1e6}),
                                thin.number("focus_distance_m", {0, 1e6, true})};
    if (calibration.lens->focus_distance_m <= calibration.lens->focal_length_m)
      thin.fail("focus_distance_m", "must be more than the focal length");
  }
  if (camera.has("response"))
    calibration.response =
        read_response(camera.object("response", response_members()), calibration.responsivity);
  return calibration;
}

void read_vignetting(const Members& m, LightCameraCalibration& calibration) {
  if (!m.has("vignetting")) return;
  const auto v = m.numbers("vignetting", 3, any);
  std::ranges::copy(v, calibration.vignetting.begin());
  if (!(least_illumination(calibration.vignetting, calibration.intrinsics.max_angle_rad) >=
        min_illumination))
    m.fail("vignetting", "must leave at least 0.01 of the light up to max_angle_deg");
}

std::optional<LightCameraCalibration> read_light_calibration(const Members& camera) {
  if (!camera.has("intrinsics")) {
    needs_intrinsics(camera, {"pose", "response"});
    return std::nullopt;
  }
  const Members m = camera.object("intrinsics", {"width", "height", "fx", "fy", "cx", "cy", "k",
                                                 "max_angle_deg", "vignetting"});
  LightCameraCalibration calibration;
  FisheyeIntrinsics& lens = calibration.intrinsics;
  read_common(m, lens);
  if (m.has("k")) {
    const auto k = m.numbers("k", 4, any);
    std::ranges::copy(k, lens.k.begin());
  }
  lens.max_angle_rad = m.number("max_angle_deg", {0, 180, true}) * std::numbers::pi / 180;
  read_vignetting(m, calibration);
  if (camera.has("response")) {
    const Members response = camera.object("response", response_members({"dark_level"}));
    calibration.response = read_response(response, calibration.responsivity);
    if (response.has("dark_level")) {
      const auto dark = response.numbers("dark_level", 3, {0, max_dark_level});
      calibration.dark_level = {dark[0], dark[1], dark[2]};
    }
  }
  calibration.world_from_camera = read_pose(camera);
  return calibration;
}

// ---- pictures, times and exposures

template <typename Number>
std::vector<Number> parse_column(const Table& table, const std::string& name,
                                 const std::string& allowed, bool (*good)(Number)) {
  std::vector<Number> values;
  for (const std::string& cell : table.column(name)) {
    Number value{};
    const char* end = cell.data() + cell.size();
    const auto result = std::from_chars(cell.data(), end, value);
    if (result.ec != std::errc{} || result.ptr != end || !good(value))
      throw Error(table.file.string() + ": column " + name + ", row " +
                  std::to_string(values.size() + 1) + ": \"" + cell + "\" must be " + allowed);
    values.push_back(value);
  }
  return values;
}

// A camera's members, with its table beside them.
struct CameraMembers {
  const Members& members;
  fs::path folder;  // that paths are relative to
  std::optional<Table> table;

  bool in_table(const std::string& column) const {
    return table && std::ranges::find(table->columns, column) != table->columns.end();
  }
  void exclude_both(const std::string& key) const {
    if (members.has(key) && in_table(key))
      members.fail(key, "is also a column of " + table->file.string() + "; one of them is allowed");
  }
};

void read_pictures(const CameraMembers& camera, FootageDescription& footage) {
  const Members& m = camera.members;
  if (m.has("pictures") && m.has("video"))
    m.fail("video", "contradicts pictures; one of them is allowed");
  if (m.has("video")) {
    footage.video = camera.folder / m.text("video");
    if (!fs::is_regular_file(footage.video))
      m.fail("video", "names " + footage.video.string() + ", which is not a file");
  } else if (m.has("pictures") && m.value("pictures").is_string()) {
    footage.pictures = matching_files(camera.folder / m.text("pictures"));
  } else if (m.has("pictures")) {
    for (const std::string& name : m.texts("pictures"))
      footage.pictures.push_back(camera.folder / name);
    if (footage.pictures.empty()) m.fail("pictures", "is empty; at least one picture is needed");
  } else if (camera.in_table("file")) {
    for (const std::string& name : camera.table->column("file"))
      footage.pictures.push_back(camera.table->file.parent_path() / name);
  } else {
    m.fail("pictures", "is missing; allowed: pictures, video, or csv with a column \"file\"");
  }
  for (const fs::path& picture : footage.pictures)
    if (!fs::is_regular_file(picture))
      throw Error(picture.string() + ": is not a file, but " + m.path("pictures") + " lists it");
}

void read_times(const CameraMembers& camera, FootageDescription& footage) {
  const Members& m = camera.members;
  camera.exclude_both("timestamps_ns");
  const bool in_table = camera.in_table("timestamp_ns");
  if (m.has("timestamps_ns") + m.has("fps") + in_table != 1)
    m.fail("timestamps_ns",
           "must be given in exactly one way: timestamps_ns, fps, or a csv with a "
           "column timestamp_ns");
  if (m.has("start_ns")) footage.start_ns = m.integer("start_ns", 0, latest_ns / 2);
  if (in_table) {
    footage.timestamps_ns = parse_column<std::int64_t>(
        *camera.table, "timestamp_ns", "a whole number of nanoseconds, not negative",
        [](std::int64_t ns) { return ns >= 0; });
  } else if (m.has("fps")) {
    footage.fps = m.number("fps", {0, 1e6, true});
  } else if (m.value("timestamps_ns").is_string()) {
    if (m.text("timestamps_ns") != "container" || footage.video.empty())
      m.fail("timestamps_ns", "must be a list, or \"container\" for a video");
  } else {
    footage.timestamps_ns = m.integers("timestamps_ns", 0, latest_ns);
    if (footage.timestamps_ns.empty()) m.fail("timestamps_ns", "is empty");
  }
  if (m.has("start_ns") && !footage.timestamps_ns.empty())
    m.fail("start_ns", "belongs to fps or \"container\" only");
  const std::size_t pictures = footage.pictures.size(), times = footage.timestamps_ns.size();
  if (pictures > 0 && times > 0 && pictures != times)
    m.fail("timestamps_ns", "has " + std::to_string(times) + " entries; there are " +
                                std::to_string(pictures) + " pictures");
}

std::vector<double> read_series(const CameraMembers& camera, const std::string& key) {
  camera.exclude_both(key);
  if (camera.in_table(key))
    return parse_column<double>(*camera.table, key, "a number above 0",
                                [](double value) { return std::isfinite(value) && value > 0; });
  const Members& m = camera.members;
  if (!m.has(key)) return {};
  if (m.value(key).is_array()) {
    auto series = m.numbers(key, 0, positive);
    if (series.empty()) m.fail(key, "is empty");
    return series;
  }
  return {m.number(key, positive)};
}

std::size_t frame_count(const FootageDescription& footage) {
  return std::max(footage.pictures.size(), footage.timestamps_ns.size());
}

void check_length(const CameraMembers& camera, const std::string& key,
                  const std::vector<double>& series, std::size_t frames) {
  if (series.size() > 1 && frames > 0 && series.size() != frames)
    camera.members.fail(key, "has " + std::to_string(series.size()) + " entries; there are " +
                                 std::to_string(frames) + " frames");
}

double at(const std::vector<double>& series, std::size_t i) {
  return series.size() == 1 ? series[0] : series[i];
}

void read_exposures(const CameraMembers& camera, double responsivity, FootageDescription& footage) {
  footage.exposure = read_series(camera, "exposure");
  footage.exposure_s = read_series(camera, "exposure_s");
  footage.gain = read_series(camera, "gain");
  const std::size_t frames = frame_count(footage);
  check_length(camera, "exposure", footage.exposure, frames);
  check_length(camera, "exposure_s", footage.exposure_s, frames);
  check_length(camera, "gain", footage.gain, frames);
  if (!footage.exposure.empty()) return;
  if (footage.exposure_s.empty())
    camera.members.fail("exposure",
                        "is missing; allowed: exposure, or exposure_s and gain; each a "
                        "number above 0, a list with one a frame, or a csv column");
  const std::vector<double> gain = footage.gain.empty() ? std::vector{1.0} : footage.gain;
  const std::size_t count = std::max(footage.exposure_s.size(), gain.size());
  for (std::size_t i = 0; i < count; ++i)
    footage.exposure.push_back(at(footage.exposure_s, i) * at(gain, i) * responsivity);
}

template <typename Value>
void reorder(std::vector<Value>& values, const std::vector<std::size_t>& order) {
  if (values.size() < order.size()) return;  // one for all, or none
  std::vector<Value> sorted;
  for (const std::size_t i : order) sorted.push_back(values[i]);
  values = std::move(sorted);
}

void order_by_time(const Members& m, FootageDescription& footage) {
  const bool sort = m.flag("sort_by_time", false);
  if (sort && !footage.video.empty()) m.fail("sort_by_time", "is not possible for a video");
  auto& times = footage.timestamps_ns;
  if (sort) {
    std::vector<std::size_t> order(times.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return times[i]; });
    reorder(footage.pictures, order);
    reorder(footage.exposure, order);
    reorder(footage.exposure_s, order);
    reorder(footage.gain, order);
    reorder(times, order);
  }
  const auto late = std::ranges::adjacent_find(times, std::greater_equal{});
  if (late == times.end()) return;
  const std::string where = "must increase; entry " + std::to_string(late - times.begin() + 2) +
                            " is " + std::to_string(late[1]) + " after " + std::to_string(late[0]);
  m.fail("timestamps_ns", sort ? where : where + " (sort_by_time: true puts frames in order)");
}

FootageDescription read_footage(const Members& m, const fs::path& folder, const std::string& source,
                                double responsivity) {
  FootageDescription footage;
  footage.source = source;
  CameraMembers camera{m, folder, {}};
  if (m.has("csv")) camera.table = read_csv(folder / m.text("csv"));
  read_pictures(camera, footage);
  read_times(camera, footage);
  read_exposures(camera, responsivity, footage);
  order_by_time(m, footage);
  return footage;
}

std::vector<std::string> camera_members(std::vector<std::string> own) {
  for (const char* common :
       {"pictures", "video", "csv", "timestamps_ns", "fps", "start_ns", "sort_by_time", "exposure",
        "exposure_s", "gain", "intrinsics", "response"})
    own.emplace_back(common);
  return own;
}

std::vector<session::TrackRecord> read_track(const Members& top) {
  std::vector<session::TrackRecord> track;
  if (!top.has("track")) return track;
  for (const Members& m :
       top.objects("track", {"frame", "world_from_camera", "covariance", "tags"})) {
    session::TrackRecord record;
    record.frame = static_cast<std::uint64_t>(m.integer("frame", 0, latest_ns));
    if (!track.empty() && record.frame <= track.back().frame)
      m.fail("frame", "must be more than the frame before, " + std::to_string(track.back().frame));
    record.tracked = true;
    record.world_from_camera = read_rigid(m, "world_from_camera");
    if (m.has("covariance")) {
      const auto covariance = m.numbers("covariance", 36, any);
      std::ranges::copy(covariance, record.covariance.begin());
    }
    if (m.has("tags"))
      for (const std::int64_t tag : m.integers("tags", 0, std::numeric_limits<int>::max()))
        record.tags.push_back(static_cast<int>(tag));
    track.push_back(std::move(record));
  }
  return track;
}

// What turns shutter time into exposure: of the calibration here, otherwise of the set's.
template <typename Calibration>
double responsivity_of(const std::optional<Calibration>& here,
                       const std::optional<Calibration>& in_set) {
  return here ? here->responsivity : in_set ? in_set->responsivity : 1.0;
}

}  // namespace

ImportDescription read_description(const fs::path& file) {
  const Json document = read_json(file);
  const fs::path folder = file.parent_path();
  const Members top(file, document, "", {"name", "clock", "set", "observer", "light", "track"});
  ImportDescription description;
  if (top.has("name")) description.name = top.text("name");
  description.clock = top.has("clock") ? top.text("clock") : "monotonic";
  set::Set set;
  if (top.has("set")) description.set = set = set::load_set(folder / top.text("set"));

  const Members observer = top.object("observer", camera_members({"lens"}));
  description.observer_calibration = read_observer_calibration(observer);
  description.observer =
      read_footage(observer, folder, "observer",
                   responsivity_of(description.observer_calibration, set.observer.calibration));
  if (top.has("light")) {
    const Members light = top.object("light", camera_members({"pose"}));
    description.light_calibration = read_light_calibration(light);
    description.light =
        read_footage(light, folder, "light",
                     responsivity_of(description.light_calibration, set.light_camera.calibration));
  }
  description.track = read_track(top);
  return description;
}

}  // namespace previz::exchange
