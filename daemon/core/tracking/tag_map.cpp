#include "daemon/core/tracking/tag_map.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <iterator>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "daemon/core/set/check.hpp"
#include "daemon/core/tracking/pose_starts.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::tracking {
namespace {

constexpr std::int64_t kMemoryNs = 500'000'000;           // an older pose is forgotten
constexpr double kReachRad = 0.035, kReachRadPerS = 3.0;  // how far a camera may have turned since
// Below this difference of chi-squares (a likelihood ratio of exp(-10)) noise alone could swap two
// poses.
constexpr double kDecisiveChiSquare = 20;
// What a search expects: how many frames' motion ahead at most, and how far off a tag may be, of
// the picture's width and of the tag.
constexpr double kFarthest = 3, kMarginShare = 64, kMarginOfTag = 0.25;
constexpr double kLeastPx = 6;             // smaller tags cannot be found
constexpr double kSamePoseChiSquare = 16;  // within each other's noise; 6 degrees of freedom

Pose to_pose(const FittedPose& fit, const std::vector<TagObservation>& tags) {
  Pose pose;
  pose.world_from_camera = world_from_camera(fit.pose);
  pose.covariance = fit.covariance;
  pose.reprojection_rms_px = fit.rms_px;
  for (std::size_t i : fit.used) pose.tags.push_back(tags[i].id);
  return pose;
}

// Returns whether b lies within the noise of a, so that there is nothing to choose between them.
bool within_noise(const FittedPose& a, const FittedPose& b) {
  const glm::dmat3 turn = a.pose.rotation * glm::transpose(b.pose.rotation);
  const glm::dvec3 axis(turn[1][2] - turn[2][1], turn[2][0] - turn[0][2], turn[0][1] - turn[1][0]);
  const double sine = glm::length(axis) / 2;
  const double angle = std::atan2(sine, (turn[0][0] + turn[1][1] + turn[2][2] - 1) / 2);
  const glm::dvec3 w = sine > 1e-12 ? axis / (2 * sine) * angle : glm::dvec3(0);
  const glm::dmat4 between = glm::inverse(world_from_camera(a.pose)) * world_from_camera(b.pose);
  const cv::Matx<double, 6, 1> d(w.x, w.y, w.z, between[3][0], between[3][1], between[3][2]);
  const cv::Matx<double, 6, 6> covariance(a.covariance.data());
  return d.dot(covariance.solve(d, cv::DECOMP_SVD)) < kSamePoseChiSquare;
}

// Returns how far from the axis the picture's corners see, on the plane z = 1, with a tenth more.
double farthest_ray(const PinholeIntrinsics& lens) {
  double most = 0;
  for (const double x : {0.0, lens.width - 1.0})
    for (const double y : {0.0, lens.height - 1.0})
      if (const auto ray = undistort(lens, {x, y}))
        most = std::max(most, std::hypot(ray->x, ray->y));
  return 1.1 * most;
}

}  // namespace

std::string tags_in_words(const std::vector<int>& ids) {
  std::string text;
  for (std::size_t i = 0; i < ids.size(); ++i)
    text += (i == 0 ? "" : i + 1 == ids.size() ? " and " : ", ") + std::to_string(ids[i]);
  return (ids.size() == 1 ? "tag " : "tags ") + text;
}

std::string doubles_in_words(const std::map<int, std::size_t>& pictures, const std::string& picture,
                             const std::string& what_is_done) {
  std::string text;
  for (const auto& [id, count] : pictures)
    add_to_list(text, tags_in_words({id}) + " is there twice in " + set::plural(count, picture));
  return text.empty() ? ""
                      : text + ": printed twice, or shown on a screen; " + what_is_done +
                            ": remove or cover the other";
}

TagMap::TagMap(const std::vector<set::Tag>& tags, const PinholeIntrinsics& lens,
               double ambiguity_ratio)
    : lens_(lens), ambiguity_ratio_(ambiguity_ratio), farthest_ray_(farthest_ray(lens)) {
  for (const set::Tag& tag : tags) {
    const std::string key = "tracking.tags: tag " + std::to_string(tag.id);
    if (!(tag.size_m > 0)) throw Error(key + ": the size must be above 0 m");
    if (!tags_.emplace(tag.id, tag).second) throw Error(key + " is in the set file twice");
  }
}

Track TagMap::locate(const std::vector<TagDetection>& detections, std::int64_t time_ns) const {
  Track track;
  std::vector<TagObservation> tags;
  std::string trouble;
  for (const TagDetection& d : detections) {
    const auto known = tags_.find(d.id);
    if (known == tags_.end()) continue;
    if (!d.trouble.empty()) {
      track.unusable.push_back({d.id, d.trouble});
      add_to_list(trouble, tags_in_words({d.id}) + ": " + d.trouble, "; ");
    } else {
      tags.push_back(
          {d.id, known->second.size_m, known->second.world_from_tag, d.corners, d.covariance});
    }
  }
  if (tags.empty()) {
    track.reason = trouble;
    return track;
  }

  std::vector<TagObservation> trusted;
  std::ranges::copy_if(tags, std::back_inserter(trusted),
                       [&](const TagObservation& tag) { return !left_out_.contains(tag.id); });
  if (!trusted.empty()) choose(solve_joint_pose(trusted, lens_, last_), trusted, time_ns, &track);
  if (track.pose || trusted.empty()) {
    std::vector<int> left_out;
    std::multiset<int> used;
    if (track.pose) used.insert(track.pose->tags.begin(), track.pose->tags.end());
    for (const TagObservation& tag : tags) {
      const auto found = used.find(tag.id);
      if (found == used.end())
        left_out.push_back(tag.id);
      else
        used.erase(found);
    }
    const auto is_twice = [&](int id) {
      return std::ranges::count(tags, id, &TagObservation::id) > 1;
    };
    std::vector<int> twice;
    std::ranges::copy_if(left_out, std::back_inserter(twice), is_twice);
    std::erase_if(left_out, is_twice);
    if (!twice.empty()) add_to_list(trouble, tags_in_words(twice) + ": there twice", "; ");
    if (!left_out.empty())
      add_to_list(trouble, tags_in_words(left_out) + ": not where the set file says", "; ");
  }
  if (!trouble.empty()) add_to_list(track.reason, trouble, "; ");
  track.observations = std::move(tags);
  return track;
}

void TagMap::remember(const Pose& pose, std::int64_t time_ns) {
  before_last_ = last_;
  before_last_time_ns_ = last_time_ns_;
  last_ = camera_from_world(pose.world_from_camera);
  last_time_ns_ = time_ns;
}

void TagMap::reset() {
  last_.reset();
  before_last_.reset();
}

void TagMap::forget_if_old(std::int64_t now_ns) {
  if (last_ && !(now_ns >= last_time_ns_ && now_ns - last_time_ns_ <= kMemoryNs)) reset();
}

CameraFromWorld TagMap::expected_pose(std::int64_t time_ns) const {
  const double between_ns = static_cast<double>(last_time_ns_ - before_last_time_ns_);
  if (!before_last_ || !(between_ns > 0)) return *last_;
  const double share =
      std::clamp(static_cast<double>(time_ns - last_time_ns_) / between_ns, 0.0, kFarthest);
  const glm::dmat4 last = world_from_camera(*last_);
  const glm::dmat4 motion = glm::inverse(world_from_camera(*before_last_)) * last;
  const glm::dquat turn =
      glm::slerp(glm::dquat(1, 0, 0, 0), glm::normalize(glm::quat_cast(glm::dmat3(motion))), share);
  glm::dmat4 next(glm::mat3_cast(turn));
  next[3] = glm::dvec4(share * glm::dvec3(motion[3]), 1);
  return camera_from_world(last * next);
}

void TagMap::expect(std::int64_t time_ns, double printed_width,
                    std::vector<ExpectedTag>& tags) const {
  if (!last_) return;
  const CameraFromWorld next = expected_pose(time_ns);
  for (const auto& [id, tag] : tags_) {
    std::optional<ExpectedTag> expected = expect(tag, next, printed_width);
    const std::optional<ExpectedTag> was = expect(tag, *last_, printed_width);
    if (!expected) continue;
    // As far again as half of what it moves, because no velocity stays.
    const glm::dvec2 moves =
        was ? glm::abs((expected->low + expected->high) - (was->low + was->high)) / 4.0
            : glm::dvec2(0);
    const glm::dvec2 margin =
        moves + lens_.width / kMarginShare + kMarginOfTag * (expected->high - expected->low);
    expected->low -= margin;
    expected->high += margin;
    tags.push_back(*expected);
  }
}

std::optional<ExpectedTag> TagMap::expect(const set::Tag& tag, const CameraFromWorld& pose,
                                          double printed_width) const {
  const glm::dvec3 eye = glm::transpose(pose.rotation) * -pose.translation;
  if (!(glm::dot(glm::dvec3(tag.world_from_tag[2]), eye - glm::dvec3(tag.world_from_tag[3])) > 0))
    return std::nullopt;
  ExpectedTag expected{tag.id, glm::dvec2(HUGE_VAL), glm::dvec2(-HUGE_VAL), true};
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec4 corner(tag_corner(printed_width * tag.size_m, i), 1);
    const glm::dvec3 x = pose.rotation * glm::dvec3(tag.world_from_tag * corner) + pose.translation;
    // Far outside the picture the lens's polynomial means nothing.
    if (!(x.z > 0) || !(std::hypot(x.x / x.z, x.y / x.z) < farthest_ray_)) return std::nullopt;
    const glm::dvec2 pixel = distort(lens_, {x.x / x.z, x.y / x.z});
    expected.low = glm::min(expected.low, pixel);
    expected.high = glm::max(expected.high, pixel);
  }
  const glm::dvec2 size(lens_.width, lens_.height);
  const glm::dvec2 middle = (expected.low + expected.high) / 2.0;
  if (!(middle.x > 0 && middle.y > 0 && middle.x < size.x && middle.y < size.y) ||
      expected.high.x - expected.low.x < kLeastPx || expected.high.y - expected.low.y < kLeastPx)
    return std::nullopt;
  expected.is_inside = expected.low.x > 0 && expected.low.y > 0 && expected.high.x < size.x - 1 &&
                       expected.high.y < size.y - 1;
  return expected;
}

bool TagMap::within_reach(const FittedPose& fit, std::int64_t time_ns) const {
  const double seconds = 1e-9 * double(time_ns - last_time_ns_);
  return last_ && rotation_between(*last_, fit.pose) <= kReachRad + kReachRadPerS * seconds;
}

void TagMap::choose(const std::vector<FittedPose>& poses, const std::vector<TagObservation>& tags,
                    std::int64_t time_ns, Track* track) const {
  std::vector<int> ids;
  for (const TagObservation& tag : tags) ids.push_back(tag.id);
  const double gate_px = consistency_gate_px(lens_);
  if (poses.empty() || !(poses.front().rms_px <= gate_px)) {
    track->reason = "no pose fits " + tags_in_words(ids);
    return;
  }

  // These are the poses that cannot be ruled out, best first.
  const FittedPose& best = poses.front();
  const double variance = std::max(1.0, best.chi_square / std::max(1, best.degrees_of_freedom));
  bool contradiction = false;
  std::vector<const FittedPose*> plausible{&best};
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const FittedPose& rival = poses[i];
    const bool worse = best.rms_px <= ambiguity_ratio_ * rival.rms_px &&
                       rival.chi_square - best.chi_square > kDecisiveChiSquare * variance;
    if (worse || (rival.used == best.used && within_noise(best, rival))) continue;
    contradiction = contradiction || rival.used != best.used;
    plausible.push_back(&rival);
  }

  const FittedPose* chosen = plausible.size() == 1 ? &best : nullptr;
  if (!chosen) {
    std::vector<const FittedPose*> reachable;
    for (const FittedPose* p : plausible)
      if (within_reach(*p, time_ns)) reachable.push_back(p);
    if (reachable.size() == 1) chosen = reachable.front();
  }
  if (chosen) {
    track->status = TrackStatus::tracked;
    track->pose = to_pose(*chosen, tags);
    return;
  }
  if (contradiction) {
    track->reason = tags_in_words(ids) + " disagree: check their [[tag]] tables";
    return;
  }
  track->status = TrackStatus::ambiguous;
  track->reason =
      std::to_string(plausible.size()) + " poses fit " + tags_in_words(ids) + " equally well";
  for (const FittedPose* p : plausible) track->candidates.push_back(to_pose(*p, tags));
}

}  // namespace previz::tracking
