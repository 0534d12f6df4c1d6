#include "tests/truth/tracking_photographs.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <sstream>

#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/core/tracking/pose_filter.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"
#include "tests/truth/tracking_measure.hpp"

namespace previz::truth {
namespace {

nlohmann::json read_json(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw Error(file.string() + ": cannot be opened");
  return nlohmann::json::parse(in);
}

std::map<std::string, std::set<int>> read_listed_ids(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw Error(file.string() + ": cannot be opened");
  std::map<std::string, std::set<int>> listed;
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string name;
    if (!(words >> name)) continue;
    for (int id; words >> id;) listed[name].insert(id);
  }
  return listed;
}

struct RoomMap {
  PinholeIntrinsics lens;
  set::Tracking settings;
};

// The map's principal point counts from a pixel's corner.
RoomMap read_room_map(const std::filesystem::path& file, int width, int height) {
  const nlohmann::json json = read_json(file);
  RoomMap map;
  const auto& k = json.at("K");
  map.lens.width = width;
  map.lens.height = height;
  map.lens.fx = k[0][0], map.lens.fy = k[1][1];
  map.lens.cx = k[0][2].get<double>() - 0.5, map.lens.cy = k[1][2].get<double>() - 0.5;
  map.lens.k1 = json.at("dist_k1k2")[0], map.lens.k2 = json.at("dist_k1k2")[1];
  for (const auto& [id, pose] : json.at("tags").items()) {
    set::Tag tag;
    tag.id = std::stoi(id);
    tag.size_m = json.at("tag_size_m");
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c)
        tag.world_from_tag[c][r] = pose.at("R")[std::size_t(r)][std::size_t(c)];
      tag.world_from_tag[3][r] = pose.at("t")[std::size_t(r)];
    }
    if (tag.id != 13) map.settings.tags.push_back(tag);
  }
  return map;
}

}  // namespace

RoomResult measure_room(const std::filesystem::path& apriltag, double decimate,
                        const ResponseCurve& response) {
  RoomResult result;
  double squares = 0;
  int corners = 0;
  for (const auto& [name, ids] : read_listed_ids(apriltag / "room" / "groundtruth_ids.txt")) {
    const std::filesystem::path file = apriltag / "room" / name;
    if (!std::filesystem::exists(file)) continue;
    const Frame frame = read_frame(file);
    const RoomMap map =
        read_room_map(apriltag / "room" / "tag_map_derived.json", frame.width, frame.height);
    tracking::TagDetector detector({}, map.lens, response);
    ++result.photographs;
    result.listed += int(ids.size());
    std::set<int> seen;
    for (const tracking::TagDetection& tag : detector.detect(frame, decimate)) {
      seen.insert(tag.id);
      result.false_ids += !ids.contains(tag.id);
    }
    for (int id : ids) {
      if (seen.contains(id))
        ++result.found;
      else
        result.missed.push_back(name + ": " + std::to_string(id));
    }

    set::Tracking settings = map.settings;
    settings.decimate = decimate;
    const tracking::Track track =
        tracking::make_apriltag_tracker(settings, map.lens, response)->track(frame);
    if (track.status != tracking::TrackStatus::tracked) {
      result.not_tracked.push_back(name + ": " + track.reason);
      continue;
    }
    ++result.tracked;
    const double rms = track.pose->reprojection_rms_px;
    const int n = int(4 * track.pose->tags.size());
    squares += n * rms * rms;
    corners += n;
  }
  result.rms_px = std::sqrt(squares / std::max(1, corners));
  return result;
}

int count_tags(const std::filesystem::path& picture, const std::string& family, double min_margin) {
  const Frame frame = read_frame(picture);
  PinholeIntrinsics lens;
  lens.width = frame.width;
  lens.height = frame.height;
  lens.fx = lens.fy = frame.width;
  lens.cx = frame.width / 2.0;
  lens.cy = frame.height / 2.0;
  tracking::TagDetector detector({family, min_margin, 1}, lens, {});
  return static_cast<int>(detector.detect(frame, 1).size());
}

namespace {

// The camera's place off the middle of its neighbours in time, rms a coordinate: the second
// difference over sqrt(6), in which white noise keeps its size.
double jitter(const std::vector<glm::dvec3>& places) {
  double squares = 0;
  for (std::size_t i = 2; i < places.size(); ++i) {
    const glm::dvec3 s = places[i] - 2.0 * places[i - 1] + places[i - 2];
    squares += glm::dot(s, s) / 6;
  }
  return places.size() > 2 ? std::sqrt(squares / double(places.size() - 2)) : 0;
}

}  // namespace

WallVideo read_wall_video(const std::filesystem::path& video) {
  const nlohmann::json camera = read_json(video.parent_path() / "camera_derived.json");
  WallVideo wall;
  PinholeIntrinsics& lens = wall.lens;
  lens.width = camera.at("width"), lens.height = camera.at("height");
  const auto& k = camera.at("K_row_major");
  lens.fx = k[0], lens.cx = k[2], lens.fy = k[4], lens.cy = k[5];
  const auto& d = camera.at("dist");
  lens.k1 = d[0], lens.k2 = d[1], lens.p1 = d[2], lens.p2 = d[3], lens.k3 = d[4];

  cv::VideoCapture capture(video.string());
  if (!capture.isOpened()) throw Error(video.string() + ": cannot be opened as a video");
  for (cv::Mat picture; capture.read(picture);) {
    cv::Mat gray(picture.rows, picture.cols, CV_8UC1);
    cv::extractChannel(picture, gray, 1);  // green: most of the luminance
    Frame frame;
    frame.width = gray.cols, frame.height = gray.rows;
    frame.format = PixelFormat::gray8;
    frame.timestamp_ns = std::int64_t(wall.frames.size()) * 33'333'333;
    frame.bytes.assign(gray.data, gray.data + gray.total());
    wall.frames.push_back(std::move(frame));
  }

  // Where tag 4 is from tag 3, as the first frames that show both without doubt have it (mean of
  // places; the first frame's rotation). The size is not stated: lengths are up to scale.
  set::Tag first, second;
  first.id = 3, second.id = 4;
  first.size_m = second.size_m = camera.at("tag_size_m_in_the_test");
  {
    set::Tracking one, other;
    one.decimate = other.decimate = 2;
    one.tags = {first}, other.tags = {second};
    const auto a = tracking::make_apriltag_tracker(one, lens);
    const auto b = tracking::make_apriltag_tracker(other, lens);
    glm::dvec3 place(0);
    int used = 0;
    for (const Frame& frame : wall.frames) {
      const tracking::Track ta = a->track(frame), tb = b->track(frame);
      if (!ta.pose || !tb.pose) continue;
      const glm::dmat4 relative =
          ta.pose->world_from_camera * glm::inverse(tb.pose->world_from_camera);
      if (used == 0) second.world_from_tag = relative;
      place += glm::dvec3(relative[3]);
      if (++used == 30) break;
    }
    if (used > 0) second.world_from_tag[3] = glm::dvec4(place / double(used), 1);
  }
  wall.tags = {first, second};
  return wall;
}

VideoResult measure_video(const WallVideo& wall, double decimate, tracking::Search search) {
  set::Tracking settings;
  settings.decimate = decimate;
  settings.tags = wall.tags;
  const auto tracker = tracking::make_apriltag_tracker(settings, wall.lens, {}, search);
  tracking::PoseFilter filter(settings, wall.lens);
  VideoResult result;
  std::vector<glm::dvec3> places, shown_places;
  double squares = 0, off_squares = 0;
  for (const Frame& frame : wall.frames) {
    const tracking::Track track = tracker->track(frame);
    const auto shown = filter.shown(track, frame.timestamp_ns);
    ++result.frames;
    const std::set<int> seen(track.seen_tags.begin(), track.seen_tags.end());
    result.with_both += seen.contains(3) && seen.contains(4);
    if (!track.pose || !shown) continue;
    ++result.tracked;
    squares += track.pose->reprojection_rms_px * track.pose->reprojection_rms_px;
    places.emplace_back(track.pose->world_from_camera[3]);
    shown_places.emplace_back(shown->world_from_camera[3]);
    const auto at = tracking::camera_from_world(shown->world_from_camera);
    const auto found = tracking::camera_from_world(track.pose->world_from_camera);
    for (const set::Tag& tag : wall.tags) {
      const glm::dvec3 middle(tag.world_from_tag[3]);
      const glm::dvec3 a = at.rotation * middle + at.translation;
      const glm::dvec3 b = found.rotation * middle + found.translation;
      const double off = glm::distance(distort(wall.lens, {a.x / a.z, a.y / a.z}),
                                       distort(wall.lens, {b.x / b.z, b.y / b.z}));
      off_squares += off * off / double(wall.tags.size());
      result.shown_worst_px = std::max(result.shown_worst_px, off);
    }
  }
  result.rms_px = std::sqrt(squares / std::max(1, result.tracked));
  result.shown_off_px = std::sqrt(off_squares / std::max(1, result.tracked));
  result.jitter_m = jitter(places);
  result.shown_jitter_m = jitter(shown_places);
  return result;
}

}  // namespace previz::truth
