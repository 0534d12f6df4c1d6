#include "daemon/tools/exchange/import_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <numeric>

#include "daemon/core/set/load.hpp"
#include "daemon/tools/exchange/film_formats.hpp"
#include "daemon/tools/exchange/import_tables.hpp"
#include "daemon/tools/exchange/json_members.hpp"
#include "daemon/tools/exchange/read_as.hpp"
#include "drivers/calibration/read.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

namespace fs = std::filesystem;

using units::plain;

constexpr Rule positive = plain.above(0);
constexpr Rule not_negative = plain.at_least(0);

// ---- calibration

glm::dmat4 read_rigid(const Members& m, const std::string& key) {
  const auto matrix = m.read<glm::dmat4>(key);
  if (const std::string fault = rigidity_fault(matrix); !fault.empty()) m.fault(key, fault);
  return nearest_rigid(matrix);
}

void needs_intrinsics(const Members& camera, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (camera.has(key))
      camera.fail(key, "needs intrinsics too; give a complete calibration or none");
}

// A camera's calibration, in members that are named as the set file's tables.
template <typename Draft>
calibration::Source calibration_source(const Members& camera) {
  std::map<std::string, std::vector<std::string>> known;
  Draft any;
  for (const calibration::Key& key : keys(any)) known[key.table].push_back(key.name);
  return {calibration::Format::authored, camera.has("lens"),
          [&camera, known](const calibration::Key& key) -> std::optional<Value> {
            if (!camera.has(key.table)) return std::nullopt;
            const Members table = camera.object(key.table, known.at(key.table));
            return table.has(key.name) ? std::optional(value_of(table.value(key.name)))
                                       : std::nullopt;
          },
          [&camera](const calibration::Key& key, std::optional<Position>, const std::string& what) {
            camera.fault(std::string(key.table) + '.' + key.name, what);
          }};
}

std::optional<ObserverCalibration> read_observer_calibration(const Members& camera) {
  if (camera.has("intrinsics"))
    return read_observer(calibration_source<calibration::ObserverDraft>(camera));
  needs_intrinsics(camera, {"lens", "response"});
  return std::nullopt;
}

std::optional<LightCameraCalibration> read_light_calibration(const Members& camera) {
  if (!camera.has("intrinsics")) {
    needs_intrinsics(camera, {"pose", "response"});
    return std::nullopt;
  }
  if (!camera.has("pose"))
    camera.fail("pose", "is missing; allowed: world_from_camera, or position_m and rotation_deg");
  return read_light_camera(calibration_source<calibration::LightCameraDraft>(camera));
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

// A camera's members together with its CSV table.
struct CameraMembers {
  const Members& members;
  fs::path folder;  // paths are relative to this
  std::optional<Table> table;

  bool in_table(const std::string& column) const {
    return table && std::ranges::find(table->columns, column) != table->columns.end();
  }
  void exclude_both(const std::string& key) const {
    if (members.has(key) && in_table(key))
      members.fail(key, "is also a column of " + table->file.string() + "; give only one of them");
  }
};

void read_pictures(const CameraMembers& camera, FootageDescription& footage) {
  const Members& m = camera.members;
  if (m.has("pictures") && m.has("video"))
    m.fail("video", "conflicts with pictures; give only one");
  if (m.has("video")) {
    const std::vector<std::string> names = m.value("video").is_array()
                                               ? m.read_list<std::string>("video")
                                               : std::vector{m.read<std::string>("video")};
    if (names.empty()) m.fail("video", "is empty; at least one file is needed");
    for (const std::string& name : names) {
      footage.videos.push_back(camera.folder / name);
      if (std::error_code none; !fs::is_regular_file(footage.videos.back(), none))
        m.fail("video", "names " + footage.videos.back().string() + ", which is not a file");
    }
  } else if (m.has("pictures") && m.value("pictures").is_string() &&
             is_video_name(m.read<std::string>("pictures"))) {
    m.fail("pictures", "is a video; use \"video\" instead of \"pictures\"");
  } else if (m.has("pictures") && m.value("pictures").is_string()) {
    footage.pictures = picture_sequence(camera.folder / m.read<std::string>("pictures"));
  } else if (m.has("pictures")) {
    std::vector<fs::path> files;
    for (const std::string& name : m.read_list<std::string>("pictures"))
      files.push_back(camera.folder / name);
    if (files.empty()) m.fail("pictures", "is empty; at least one picture is needed");
    footage.pictures = whole_sequence(std::move(files));
  } else if (camera.in_table("file")) {
    std::vector<fs::path> files;
    for (const std::string& name : camera.table->column("file"))
      files.push_back(camera.table->file.parent_path() / name);
    footage.pictures = whole_sequence(std::move(files));
  } else {
    m.fail("pictures", "is missing; allowed: pictures, video, or csv with a column \"file\"");
  }
  footage.read_as = read_read_as(m);
  if (footage.read_as.matrix && footage.videos.empty())
    m.fail("read_as", "has a matrix, which pictures do not have; remove it");
  for (const fs::path& picture : footage.pictures.files)
    if (std::error_code none; !fs::is_regular_file(picture, none))
      throw Error(picture.string() + ": is not a file, but " + m.path("pictures") + " lists it");
}

void read_times(const CameraMembers& camera, FootageDescription& footage) {
  const Members& m = camera.members;
  camera.exclude_both("timestamps_ns");
  const bool in_table = camera.in_table("timestamp_ns");
  const int ways = m.has("timestamps_ns") + m.has("fps") + in_table;
  const bool is_in_video = ways == 0 && !footage.videos.empty();  // as "container"
  if (ways == 0 && !is_in_video)
    m.fail("fps",
           "is missing: the pictures have no times; allowed: fps, timestamps_ns, or "
           "a csv with a column timestamp_ns");
  if (ways > 1)
    m.fail(m.has("timestamps_ns") ? "timestamps_ns" : "fps",
           "conflicts with another member: give the times in exactly one way, by "
           "timestamps_ns, fps, or a csv with a column timestamp_ns");
  if (m.has("start_ns"))
    footage.start_ns =
        m.read<std::int64_t>("start_ns", plain.within(0, static_cast<double>(latest_ns) / 2));
  if (in_table) {
    footage.timestamps_ns = parse_column<std::int64_t>(
        *camera.table, "timestamp_ns", "a whole number of nanoseconds, not negative",
        [](std::int64_t ns) { return ns >= 0; });
  } else if (m.has("fps")) {
    footage.fps = m.read<double>("fps", plain.above(0, 1e6));
  } else if (!is_in_video && m.value("timestamps_ns").is_string()) {
    if (m.read<std::string>("timestamps_ns") != "container" || footage.videos.empty())
      m.fail("timestamps_ns", "must be a list, or \"container\" for a video");
  } else if (!is_in_video) {
    footage.timestamps_ns = m.read_list<std::int64_t>("timestamps_ns", not_negative);
    if (footage.timestamps_ns.empty()) m.fail("timestamps_ns", "is empty");
  }
  if (m.has("start_ns") && !footage.timestamps_ns.empty())
    m.fail("start_ns", "needs fps or \"container\"");
  const std::size_t pictures = footage.pictures.files.size(), times = footage.timestamps_ns.size();
  if (pictures > 0 && times > 0)  // which say of each picture when it was taken
    footage.pictures = whole_sequence(std::move(footage.pictures.files));
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
    auto series = m.read_list<double>(key, positive);
    if (series.empty()) m.fail(key, "is empty");
    return series;
  }
  return {m.read<double>(key, positive)};
}

// Returns the number of frames that is described; 0: it is not known yet, as of a video without
// times. The lists of such a video must all be for as many.
std::size_t frame_count(const FootageDescription& footage) {
  std::size_t count = std::max(footage.pictures.files.size() + footage.pictures.missing,
                               footage.timestamps_ns.size());
  if (count > 0) return count;
  for (const auto* series : {&footage.exposure, &footage.exposure_s, &footage.gain})
    if (series->size() > 1) count = std::max(count, series->size());
  return count;
}

void check_length(const CameraMembers& camera, const std::string& key,
                  const std::vector<double>& series, const FootageDescription& footage) {
  const std::size_t frames = frame_count(footage);
  const std::string& lost = footage.pictures.words;
  if (series.size() > 1 && frames > 0 && series.size() != frames)
    camera.members.fail(
        key,
        "has " + std::to_string(series.size()) + " entries; there are " + std::to_string(frames) +
            " frames" +
            (lost.empty() ? "" : ", with those that are lost (" + lost + "): give each an entry"));
}

double at(const std::vector<double>& series, std::size_t i) {
  return series.size() == 1 ? series[0] : series[i];
}

void read_exposures(const CameraMembers& camera, double responsivity, FootageDescription& footage) {
  footage.exposure = read_series(camera, "exposure");
  footage.exposure_s = read_series(camera, "exposure_s");
  footage.gain = read_series(camera, "gain");
  check_length(camera, "exposure", footage.exposure, footage);
  check_length(camera, "exposure_s", footage.exposure_s, footage);
  check_length(camera, "gain", footage.gain, footage);
  if (!footage.exposure.empty()) return;
  if (footage.exposure_s.empty())
    camera.members.fail("exposure",
                        "is missing; allowed: exposure, or exposure_s and gain; each a "
                        "number above 0, a list with one per frame, or a csv column (if unknown, "
                        "give 1: the set's light is then in units of the camera's white)");
  const std::vector<double> gain = footage.gain.empty() ? std::vector{1.0} : footage.gain;
  const std::size_t count = std::max(footage.exposure_s.size(), gain.size());
  for (std::size_t i = 0; i < count; ++i) {
    footage.exposure.push_back(at(footage.exposure_s, i) * at(gain, i) * responsivity);
    if (const double exposure = footage.exposure.back(); !(exposure > 0 && std::isfinite(exposure)))
      camera.members.fault(
          "exposure_s",
          fmt::format("frame {}: {:g} s times gain {:g} times responsivity {:g} "
                      "is {:g}; an exposure must be finite and above 0: check "
                      "the units",
                      i, at(footage.exposure_s, i), at(gain, i), responsivity, exposure));
  }
}

template <typename Value>
void reorder(std::vector<Value>& values, const std::vector<std::size_t>& order) {
  if (values.size() < order.size()) return;  // one for all, or none
  std::vector<Value> sorted;
  for (const std::size_t i : order) sorted.push_back(values[i]);
  values = std::move(sorted);
}

void order_by_time(const Members& m, FootageDescription& footage) {
  const bool sort = m.has("sort_by_time") && m.read<bool>("sort_by_time");
  if (sort && !footage.videos.empty()) m.fail("sort_by_time", "is not possible for a video");
  auto& times = footage.timestamps_ns;
  if (sort) {
    std::vector<std::size_t> order(times.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return times[i]; });
    reorder(footage.pictures.files, order);
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
  if (m.has("csv")) camera.table = read_csv(folder / m.read<std::string>("csv"));
  read_pictures(camera, footage);
  read_times(camera, footage);
  read_exposures(camera, responsivity, footage);
  order_by_time(m, footage);
  return footage;
}

std::vector<std::string> camera_members(std::vector<std::string> own) {
  for (const char* common :
       {"pictures", "video", "read_as", "csv", "timestamps_ns", "fps", "start_ns", "sort_by_time",
        "exposure", "exposure_s", "gain", "intrinsics", "response"})
    own.emplace_back(common);
  return own;
}

std::vector<session::TrackRecord> read_track(const Members& top) {
  std::vector<session::TrackRecord> track;
  if (!top.has("track")) return track;
  for (const Members& m :
       top.objects("track", {"frame", "world_from_camera", "covariance", "tags"})) {
    session::TrackRecord record;
    record.frame = static_cast<std::uint64_t>(m.read<std::int64_t>("frame", not_negative));
    if (!track.empty() && record.frame <= track.back().frame)
      m.fail("frame",
             "must be greater than the previous frame, " + std::to_string(track.back().frame));
    record.tracked = true;
    record.world_from_camera = read_rigid(m, "world_from_camera");
    if (m.has("covariance")) record.covariance = m.read<std::array<double, 36>>("covariance");
    if (m.has("tags")) record.tags = m.read_list<int>("tags", not_negative);
    track.push_back(std::move(record));
  }
  return track;
}

// Returns the factor from shutter time to exposure, from the calibration here, otherwise from the
// set's.
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
  if (top.has("name")) description.name = top.read<std::string>("name");
  description.clock = top.has("clock") ? top.read<std::string>("clock") : "monotonic";
  set::Set set;
  if (top.has("set")) description.set = set = set::load_set(folder / top.read<std::string>("set"));

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
