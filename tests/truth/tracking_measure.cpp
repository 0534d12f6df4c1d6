#include "tests/truth/tracking_measure.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "daemon/core/scene/load.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/core/tracking/pose_filter.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::truth {
namespace {

std::vector<glm::dvec3> virtual_vertices(const TruthSet& set) {
  set::Set objects = set_of(set);
  objects.objects.erase(objects.objects.begin());  // the phantom
  const scene::Scene scene = scene::load_scene(objects);
  std::vector<glm::dvec3> vertices;
  for (const scene::Instance& instance : scene.instances)
    for (const glm::vec3& p : scene.meshes[instance.mesh].positions)
      vertices.emplace_back(instance.world_from_object * glm::dvec4(p, 1));
  return vertices;
}

std::optional<glm::dvec2> project(const PinholeIntrinsics& lens,
                                  const tracking::CameraFromWorld& pose, glm::dvec3 world) {
  const glm::dvec3 x = pose.rotation * world + pose.translation;
  if (!(x.z > 0)) return std::nullopt;
  const glm::dvec2 p = distort(lens, {x.x / x.z, x.y / x.z});
  if (!(p.x >= -0.5 && p.y >= -0.5 && p.x < lens.width - 0.5 && p.y < lens.height - 0.5))
    return std::nullopt;
  return p;
}

std::vector<std::optional<glm::dvec2>> exact_corners(const TruthSet& set, const set::Tag& tag,
                                                     const tracking::CameraFromWorld& pose) {
  std::vector<std::optional<glm::dvec2>> corners;
  for (std::size_t i = 0; i < 4; ++i)
    corners.push_back(
        project(set.observer.intrinsics, pose,
                tag.world_from_tag * glm::dvec4(tracking::tag_corner(tag.size_m, i), 1)));
  return corners;
}

// The motion d with truth = estimate * d, rotation then translation, against the covariance.
double normalised_error(const tracking::Pose& pose, const glm::dmat4& truth) {
  const glm::dmat4 d = glm::inverse(pose.world_from_camera) * truth;
  const glm::dquat q = glm::normalize(glm::quat_cast(glm::dmat3(d)));
  const double angle = glm::angle(q.w < 0 ? -q : q);
  const glm::dvec3 w = glm::axis(q.w < 0 ? -q : q) * angle;
  const cv::Matx<double, 6, 1> e(w.x, w.y, w.z, d[3][0], d[3][1], d[3][2]);
  return e.dot(cv::Matx<double, 6, 6>(pose.covariance.data()).solve(e, cv::DECOMP_SVD));
}

void compare_pose(const TruthSet& set, const std::vector<glm::dvec3>& vertices,
                  const glm::dmat4& truth_pose, TrackedFrame* row) {
  const PinholeIntrinsics& lens = set.observer.intrinsics;
  const auto truth = tracking::camera_from_world(truth_pose);
  const auto tracked = tracking::camera_from_world(row->track.pose->world_from_camera);
  const auto mean_distance = [&](const std::vector<glm::dvec3>& points, double* most) {
    double sum = 0;
    int count = 0;
    for (const glm::dvec3& p : points) {
      const auto a = project(lens, truth, p), b = project(lens, tracked, p);
      if (!a || !b) continue;
      const double d = glm::distance(*a, *b);
      sum += d;
      *most = std::max(*most, d);
      ++count;
    }
    return count ? sum / count : 0.0;
  };
  row->vertex_px = mean_distance(vertices, &row->vertex_max_px);
  std::vector<glm::dvec3> corners;
  for (int id : row->track.pose->tags)
    for (const set::Tag& tag : set.tags)
      if (tag.id == id)
        for (std::size_t i = 0; i < 4; ++i)
          corners.emplace_back(tag.world_from_tag *
                               glm::dvec4(tracking::tag_corner(tag.size_m, i), 1));
  double most = 0;
  row->reprojection_px = mean_distance(corners, &most);
  row->rotation_rad = tracking::rotation_between(truth, tracked);
  row->translation_m =
      glm::distance(glm::dvec3(truth_pose[3]), glm::dvec3(row->track.pose->world_from_camera[3]));
  row->error_squared = normalised_error(*row->track.pose, truth_pose);
}

// By vertex: where it is minus where it should be; absent outside the picture.
using VertexErrors = std::vector<std::optional<glm::dvec2>>;

VertexErrors vertex_errors(const PinholeIntrinsics& lens, const std::vector<glm::dvec3>& vertices,
                           const glm::dmat4& truth, const glm::dmat4& pose) {
  VertexErrors errors;
  for (const glm::dvec3& vertex : vertices) {
    const auto should = project(lens, tracking::camera_from_world(truth), vertex);
    const auto is = project(lens, tracking::camera_from_world(pose), vertex);
    errors.push_back(should && is ? std::optional(*is - *should) : std::nullopt);
  }
  return errors;
}

// The mean length of the errors minus `others`, which may be empty, over the vertices that both
// have.
std::optional<double> mean_length(const VertexErrors& errors, const VertexErrors& others) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (!errors[i] || (!others.empty() && !others[i])) continue;
    sum += glm::length(others.empty() ? *errors[i] : *errors[i] - *others[i]);
    ++count;
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

}  // namespace

Frame read_frame(const std::filesystem::path& file) {
  cv::Mat picture = cv::imread(file.string(), cv::IMREAD_UNCHANGED | cv::IMREAD_IGNORE_ORIENTATION);
  if (picture.empty()) throw Error(file.string() + ": cannot be read as a picture");
  Frame frame;
  frame.source = "observer";
  frame.width = picture.cols;
  frame.height = picture.rows;
  const bool deep = picture.depth() == CV_16U;
  if (picture.channels() == 1) {
    frame.format = deep ? PixelFormat::gray16 : PixelFormat::gray8;
  } else {
    frame.format = deep ? PixelFormat::rgb16 : PixelFormat::rgb8;
    cv::Mat rgb(picture.rows, picture.cols, deep ? CV_16UC3 : CV_8UC3);
    const int pairs[6] = {2, 0, 1, 1, 0, 2};  // OpenCV's order is B, G, R
    cv::mixChannels(&picture, 1, &rgb, 1, pairs, 3);
    picture = rgb;
  }
  const std::size_t bytes = picture.total() * picture.elemSize();
  frame.bytes.assign(picture.data, picture.data + bytes);
  return frame;
}

set::Tracking tracking_settings(const TruthSet& set) {
  set::Tracking settings;
  settings.family = set.tag_family;
  settings.tags = set.tags;
  return settings;
}

std::vector<TrackedFrame> measure_tracking(const TruthSet& set, const set::Tracking& settings,
                                           tracking::Search search) {
  const PinholeIntrinsics& lens = set.observer.intrinsics;
  const std::vector<glm::dvec3> vertices = virtual_vertices(set);
  const auto tracker =
      tracking::make_apriltag_tracker(settings, lens, set.observer.response, search);
  tracking::PoseFilter filter(settings, lens);
  VertexErrors last_found, last_shown;
  tracking::TagDetector detector({settings.family, settings.min_margin, settings.max_hamming}, lens,
                                 set.observer.response);
  std::vector<TrackedFrame> rows;
  for (const ObserverFrame& observed : set.frames) {
    Frame frame = read_frame(observed.file);
    frame.timestamp_ns = observed.timestamp_ns;
    TrackedFrame row;
    row.index = observed.index;
    row.track = tracker->track(frame);
    if (row.track.pose) compare_pose(set, vertices, observed.world_from_camera, &row);
    const auto shown = filter.shown(row.track, frame.timestamp_ns);
    const auto errors = [&](const glm::dmat4* pose) {
      return pose ? vertex_errors(lens, vertices, observed.world_from_camera, *pose)
                  : VertexErrors{};
    };
    const VertexErrors found =
        errors(row.track.pose ? &row.track.pose->world_from_camera : nullptr);
    const VertexErrors here = errors(shown ? &shown->world_from_camera : nullptr);
    if (shown) {
      row.held_s = shown->held_s;
      row.shown_px = mean_length(here, {});
    }
    row.jitter_px = mean_length(found, last_found);
    row.shown_jitter_px = mean_length(here, last_shown);
    if (found.empty() || last_found.empty()) row.jitter_px.reset();
    if (here.empty() || last_shown.empty()) row.shown_jitter_px.reset();
    last_found = found;
    last_shown = here;

    const auto truth = tracking::camera_from_world(observed.world_from_camera);
    const auto detections = detector.detect(frame, settings.decimate);
    for (const set::Tag& tag : set.tags) {
      const auto exact = exact_corners(set, tag, truth);
      for (const tracking::TagDetection& d : detections) {
        if (d.id != tag.id) continue;
        CornerError error{d.id, d.trouble, {}, 0};
        cv::Matx<double, 8, 1> e = cv::Matx<double, 8, 1>::zeros();
        for (std::size_t i = 0; i < 4; ++i) {
          if (!exact[i]) continue;
          error.error_px.push_back(d.corners[i] - *exact[i]);
          e(int(2 * i)) = error.error_px.back().x;
          e(int(2 * i) + 1) = error.error_px.back().y;
        }
        error.chi_square =
            e.dot(cv::Matx<double, 8, 8>(d.covariance.data()).solve(e, cv::DECOMP_SVD));
        row.corners.push_back(std::move(error));
      }
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace previz::truth
