#include "daemon/tools/calibrate/lens/light_pose.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <iterator>
#include <map>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/pose_starts.hpp"
#include "daemon/tools/calibrate/lens/bundle.hpp"
#include "daemon/tools/calibrate/lens/fisheye.hpp"
#include "daemon/tools/calibrate/lens/fisheye_tags.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t most_pictures = 20;
constexpr double consistent_px = 2;  // rms of a tag's corners

// All of the set's tags in all pictures, as one view of the stage.
struct Sighting {
  View view{"light camera", {}, {}};
  std::vector<int> ids;  // each corner's tag
  int pictures = 0;
};

void add(const tracking::TagDetection& seen, const set::Tag& tag, Sighting& sighting) {
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec4 corner(tracking::tag_corner(tag.size_m, i), 1);
    sighting.view.points.emplace_back(tag.world_from_tag * corner);
    sighting.view.pixels.push_back(seen.corners[i]);
    sighting.ids.push_back(seen.id);
  }
}

Sighting look(PictureSource& source, const FisheyeIntrinsics& intrinsics,
              const ResponseCurve& response, const set::Tracking& tracking) {
  const tracking::DetectorSettings settings{tracking.family, tracking.min_margin,
                                            tracking.max_hamming};
  const std::size_t count = source.count().value_or(most_pictures);
  const std::size_t every = std::max<std::size_t>(1, (count + most_pictures - 1) / most_pictures);
  Sighting sighting;
  std::size_t index = 0;
  for (auto picture = source.next(); picture && index < every * most_pictures;
       picture = source.next()) {
    if (index++ % every) continue;
    const Frame& frame = *picture->frame;
    if (frame.width != intrinsics.width || frame.height != intrinsics.height)
      throw Error(picture->name + ": has " + std::to_string(frame.width) + "x" +
                  std::to_string(frame.height) + " pixels, the light camera is calibrated for " +
                  std::to_string(intrinsics.width) + "x" + std::to_string(intrinsics.height));
    const std::size_t before = sighting.ids.size();
    for (const auto& seen : detect_in_fisheye(frame, intrinsics, response, settings)) {
      const auto tag = std::ranges::find(tracking.tags, seen.id, &set::Tag::id);
      if (tag != tracking.tags.end()) add(seen, *tag, sighting);
    }
    if (sighting.ids.size() > before) ++sighting.pictures;
  }
  return sighting;
}

std::vector<int> different(std::vector<int> ids) {
  std::ranges::sort(ids);
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

// Returns the standard deviation along the longest axis of a 3x3 covariance.
double longest_axis(const cv::Matx33d& covariance) {
  cv::Mat1d values;  // in falling order
  cv::eigen(covariance, values);
  return std::sqrt(std::max(0.0, values(0)));
}

// Returns the covariance of the camera's position, in the camera's axes: a rotation w and a
// translation v of camera_from_world move the position by w cross t - v.
cv::Matx33d place_covariance(const cv::Matx66d& covariance, const glm::dvec3& t) {
  const double rows[] = {0,    t.z,  -t.y, -1, 0,  0,  //
                         -t.z, 0,    t.x,  0,  -1, 0,  //
                         t.y,  -t.x, 0,    0,  0,  -1};
  const cv::Matx<double, 3, 6> by_motion(rows);
  return by_motion * covariance * by_motion.t();
}

View corners_of(const Sighting& sighting, const std::vector<int>& ids) {
  View view{sighting.view.name, {}, {}};
  for (std::size_t i = 0; i < sighting.ids.size(); ++i)
    if (std::ranges::find(ids, sighting.ids[i]) != ids.end()) {
      view.points.push_back(sighting.view.points[i]);
      view.pixels.push_back(sighting.view.pixels[i]);
    }
  return view;
}

// Fits a pose to some of the tags; returns nothing if no pose explains them.
std::optional<BundleFit> fit_to(const Sighting& sighting, const std::vector<int>& ids,
                                const FisheyeIntrinsics& intrinsics) {
  const View view = corners_of(sighting, ids);
  const auto start = pose_by_rays(view, Fisheye(intrinsics));
  if (!start) return std::nullopt;
  const Projection known = [&](std::span<const double>, const glm::dvec3& point) {
    return std::optional(fisheye_pixel(intrinsics, point));
  };
  return fit_bundle({view}, {{}, {*start}}, known);
}

std::vector<int> explained(const Sighting& sighting, const tracking::CameraFromWorld& pose,
                           const FisheyeIntrinsics& intrinsics) {
  struct Error {
    double squares = 0;
    int corners = 0;
  };
  std::map<int, Error> errors;
  for (std::size_t i = 0; i < sighting.ids.size(); ++i) {
    const glm::dvec2 e =
        sighting.view.pixels[i] -
        fisheye_pixel(intrinsics, pose.rotation * sighting.view.points[i] + pose.translation);
    Error& error = errors[sighting.ids[i]];
    error.squares += glm::dot(e, e);
    ++error.corners;
  }
  std::vector<int> ids;
  for (const auto& [id, error] : errors)
    if (error.squares <= consistent_px * consistent_px * error.corners) ids.push_back(id);
  return ids;
}

// Returns the largest set of tags that one pose explains.
std::vector<int> consistent_tags(const Sighting& sighting, const std::vector<int>& ids,
                                 const FisheyeIntrinsics& intrinsics) {
  std::vector<std::vector<int>> trials{ids};
  for (std::size_t out = 0; out < ids.size() && ids.size() > 2; ++out) {
    trials.push_back(ids);
    trials.back().erase(trials.back().begin() + std::ptrdiff_t(out));
  }
  std::vector<int> best;
  for (const std::vector<int>& trial : trials)
    if (const auto fit = fit_to(sighting, trial, intrinsics))
      if (auto all = explained(sighting, fit->bundle.poses[0], intrinsics);
          all.size() > best.size())
        best = std::move(all);
  return best;
}

}  // namespace

LightPose find_light_pose(PictureSource& source, const FisheyeIntrinsics& intrinsics,
                          const ResponseCurve& response, const set::Tracking& tracking) {
  const Sighting sighting = look(source, intrinsics, response, tracking);
  const std::vector<int> ids = different(sighting.ids);
  if (ids.size() < 2)
    throw Error(ids.empty() ? "the light camera sees none of the set's tags"
                            : "the light camera sees only tag " + std::to_string(ids[0]) +
                                  " of the set; it needs two, because one tag fits two poses");
  LightPose pose;
  pose.pictures = sighting.pictures;
  pose.tags = consistent_tags(sighting, ids, intrinsics);
  std::ranges::set_difference(ids, pose.tags, std::back_inserter(pose.left_out));
  if (pose.tags.size() < 2)
    throw Error(
        "the tags that the light camera sees disagree: is one of them not "
        "where the set file says?");
  const BundleFit fit = *fit_to(sighting, pose.tags, intrinsics);
  pose.world_from_camera = tracking::world_from_camera(fit.bundle.poses[0]);
  pose.rms_px = fit.rms_px;
  const cv::Matx66d covariance(fit.pose_covariances[0].data());
  pose.rotation_sigma_rad = longest_axis(covariance.get_minor<3, 3>(0, 0));
  pose.position_sigma_m =
      longest_axis(place_covariance(covariance, fit.bundle.poses[0].translation));
  return pose;
}

}  // namespace previz::calibrate
