#include "daemon/tools/model/views.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>
#include <map>

#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

// A session's picture is "takes/12A/observer frame 7"; --pictures calls its file frame_7.png.
bool is_named(const std::string& name, const std::string& wanted) {
  std::string of_file = wanted.ends_with(".png") ? wanted.substr(0, wanted.size() - 4) : wanted;
  std::ranges::replace(of_file, '_', ' ');
  return name == wanted || name.ends_with('/' + wanted) || name.ends_with(' ' + wanted) ||
         name.ends_with(' ' + of_file);
}

}  // namespace

std::string short_name(const std::string& name) {
  const std::size_t frame = name.rfind(" frame ");
  if (frame != std::string::npos) return name.substr(frame + 1);
  return std::filesystem::path(name).filename().string();
}

void insist_on_size(const Frame& frame, const PinholeIntrinsics& lens, const std::string& picture) {
  if (frame.width != lens.width || frame.height != lens.height)
    throw Error(fmt::format("{}: has {}x{} pixels, but the lens is calibrated for {}x{}", picture,
                            frame.width, frame.height, lens.width, lens.height));
}

namespace {

void insist_on_marks(const MarkedPicture& picture, const PinholeIntrinsics& lens) {
  for (const Mark& mark : picture.marks)
    if (!(mark.px.x >= -0.5 && mark.px.y >= -0.5 && mark.px.x <= lens.width - 0.5 &&
          mark.px.y <= lens.height - 0.5))
      throw Error(
          fmt::format("{}: point \"{}\" at {:.1f}, {:.1f} is outside of the picture's {}x{} pixels",
                      picture.name, mark.point, mark.px.x, mark.px.y, lens.width, lens.height));
}

tracking::FittedPose pose_of(const std::vector<tracking::TagDetection>& detections,
                             const PinholeIntrinsics& lens, const set::Tracking& tracking,
                             const std::string& picture) {
  const auto pose = pose_by_tags(detections, lens, tracking);
  if (!pose)
    throw Error(picture +
                ": shows no tags of the set that fit together, so where the camera stood is "
                "unknown; mark the points in another picture, or check the [[tag]] tables");
  return *pose;
}

}  // namespace

Views find_views(calibrate::PictureSource& source, const ObserverCalibration& camera,
                 const set::Tracking& tracking, const Parts& parts) {
  Views views{camera.intrinsics, tracking.family, std::vector<MarkedView>(parts.pictures.size())};
  tracking::TagDetector detector({tracking.family, tracking.min_margin, tracking.max_hamming},
                                 camera.intrinsics, camera.response);
  std::size_t found = 0;
  std::string first, last;
  for (auto picture = source.next(); picture && found < views.views.size();
       picture = source.next()) {
    if (first.empty()) first = short_name(picture->name);
    last = short_name(picture->name);
    const MarkedPicture* first_of_it = nullptr;
    for (std::size_t i = 0; i < parts.pictures.size(); ++i) {
      const MarkedPicture& marked = parts.pictures[i];
      if (!is_named(picture->name, marked.name) || !views.views[i].name.empty()) continue;
      if (first_of_it)
        throw Error(
            fmt::format("{}: \"{}\" and \"{}\" are the same picture; put all its points into one "
                        "[[picture]]",
                        parts.file.string(), first_of_it->name, marked.name));
      first_of_it = &marked;
      insist_on_size(*picture->frame, camera.intrinsics, marked.name);
      insist_on_marks(marked, camera.intrinsics);
      views.views[i] = {
          marked.name, marked.marks,
          pose_of(detector.detect(*picture->frame, 1), camera.intrinsics, tracking, marked.name),
          picture->frame};
      ++found;
    }
  }
  for (std::size_t i = 0; i < parts.pictures.size(); ++i)
    if (views.views[i].name.empty())
      throw Error(fmt::format(
          "{}: there is no picture \"{}\"; the pictures are named like \"{}\" and \"{}\"",
          parts.file.string(), parts.pictures[i].name, first, last));
  return views;
}

Ray ray_of(const Views& views, const MarkedView& view, const Mark& mark) {
  const auto ray =
      tracking::ray_through(views.lens, tracking::world_from_camera(view.pose.pose), mark.px);
  if (!ray)
    throw Error(
        fmt::format("{}: the lens shows nothing at point \"{}\"; check the lens's distortion",
                    view.name, mark.point));
  return *ray;
}

std::optional<tracking::FittedPose> pose_by_tags(
    const std::vector<tracking::TagDetection>& detections, const PinholeIntrinsics& lens,
    const set::Tracking& tracking) {
  std::vector<tracking::TagObservation> seen;
  for (const tracking::TagDetection& detection : detections) {
    const auto tag = std::ranges::find(tracking.tags, detection.id, &set::Tag::id);
    if (tag != tracking.tags.end() && detection.trouble.empty())
      seen.push_back(
          {tag->id, tag->size_m, tag->world_from_tag, detection.corners, detection.covariance});
  }
  if (seen.empty()) return {};
  const auto poses = tracking::solve_joint_pose(seen, lens, std::nullopt);
  return poses.empty() ? std::nullopt : std::optional(poses.front());
}

tracking::CameraFromWorld adjusted_pose(const MarkedView& view, const std::array<double, 6>& off) {
  const glm::dmat3 turn = glm::transpose(tracking::rotation_by({off[0], off[1], off[2]}));
  const auto& pose = view.pose.pose;
  return {turn * pose.rotation, turn * (pose.translation - glm::dvec3(off[3], off[4], off[5]))};
}

glm::dvec2 projected(const PinholeIntrinsics& lens, const glm::dvec3& in_camera) {
  if (!(in_camera.z > 0)) return glm::dvec2(std::numeric_limits<double>::quiet_NaN());
  return distort(lens, glm::dvec2(in_camera) / in_camera.z);
}

}  // namespace previz::model
