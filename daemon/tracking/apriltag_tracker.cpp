#include "daemon/tracking/apriltag_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <set>

#include "daemon/tracking/joint_pose.hpp"
#include "daemon/tracking/tag_detector.hpp"
#include "drivers/error.hpp"

namespace previz::tracking {
namespace {

constexpr std::int64_t kMemoryNs = 500'000'000;           // a pose older than this says nothing
constexpr double kReachRad = 0.035, kReachRadPerS = 3.0;  // how far a camera may have turned
// Likelihood ratio exp(-10): below this difference of chi-squares noise alone could swap two poses.
constexpr double kDecisiveChiSquare = 20;
constexpr double kSamePoseChiSquare = 16;  // two poses within each other's noise, 6 degrees

std::string join(const std::vector<int>& ids) {
  std::string text;
  for (std::size_t i = 0; i < ids.size(); ++i)
    text += (i == 0 ? "" : i + 1 == ids.size() ? " and " : ", ") + std::to_string(ids[i]);
  return (ids.size() == 1 ? "tag " : "tags ") + text;
}

Pose to_pose(const FittedPose& fit, const std::vector<TagObservation>& tags) {
  Pose pose;
  pose.world_from_camera = world_from_camera(fit.pose);
  pose.covariance = fit.covariance;
  pose.reprojection_rms_px = fit.rms_px;
  for (std::size_t i : fit.used) pose.tags.push_back(tags[i].id);
  return pose;
}

// Whether b lies within the noise of a: then there is nothing to choose between.
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

class AprilTagTracker final : public Tracker {
 public:
  AprilTagTracker(const set::Tracking& settings, const PinholeIntrinsics& lens,
                  const ResponseCurve& response)
      : settings_(settings),
        lens_(lens),
        detector_({settings.family, settings.min_margin, settings.max_hamming}, lens, response) {
    for (const set::Tag& tag : settings_.tags) {
      const std::string key = "tracking.tags: tag " + std::to_string(tag.id);
      if (!(tag.size_m > 0)) throw Error(key + ": the size must be above 0 m");
      if (!map_.emplace(tag.id, &tag).second) throw Error(key + " is in the map twice");
    }
    if (lens.width < 1 || lens.height < 1 || !(lens.fx > 0) || !(lens.fy > 0))
      throw Error("observer.intrinsics: width, height, fx and fy must be above 0 to track with");
  }

  Track track(const Frame& frame) override {
    Track track;
    if (frame.width != lens_.width || frame.height != lens_.height ||
        frame.bytes.size() != frame_bytes(frame.format, frame.width, frame.height)) {
      track.reason = "the frame is " + std::to_string(frame.width) + "x" +
                     std::to_string(frame.height) + " of " + std::to_string(frame.bytes.size()) +
                     " bytes, the calibration is for " + std::to_string(lens_.width) + "x" +
                     std::to_string(lens_.height);
      following_ = false;
      return track;
    }
    if (last_ &&
        !(frame.timestamp_ns >= last_time_ns_ && frame.timestamp_ns - last_time_ns_ <= kMemoryNs))
      last_.reset();

    const double decimate = following_ ? std::max(1.0, settings_.decimate) : 1.0;
    track = locate(detector_.detect(frame, decimate), frame.timestamp_ns);
    if (track.status != TrackStatus::tracked && decimate > 1)
      track = locate(detector_.detect(frame, 1), frame.timestamp_ns);
    following_ = track.status == TrackStatus::tracked;
    if (track.pose) {
      last_ = camera_from_world(track.pose->world_from_camera);
      last_time_ns_ = frame.timestamp_ns;
    }
    return track;
  }

  void reset() override {
    last_.reset();
    following_ = false;
  }

 private:
  Track locate(const std::vector<TagDetection>& detections, std::int64_t time_ns) const;
  bool within_reach(const FittedPose& fit, std::int64_t time_ns) const;
  void choose(const std::vector<FittedPose>& poses, const std::vector<TagObservation>& tags,
              std::int64_t time_ns, Track* track) const;

  set::Tracking settings_;
  PinholeIntrinsics lens_;
  TagDetector detector_;
  std::map<int, const set::Tag*> map_;
  std::optional<CameraFromWorld> last_;
  std::int64_t last_time_ns_ = 0;
  bool following_ = false;  // the frame before was tracked
};

Track AprilTagTracker::locate(const std::vector<TagDetection>& detections,
                              std::int64_t time_ns) const {
  Track track;
  std::vector<TagObservation> tags;
  std::string trouble;
  const auto add = [&](const std::string& text) {
    trouble += (trouble.empty() ? "" : "; ") + text;
  };
  std::vector<int> strangers;
  for (const TagDetection& d : detections) {
    track.seen_tags.push_back(d.id);
    const auto known = map_.find(d.id);
    if (known == map_.end()) {
      strangers.push_back(d.id);
    } else if (!d.trouble.empty()) {
      add(join({d.id}) + ": " + d.trouble);
    } else {
      tags.push_back(
          {d.id, known->second->size_m, known->second->world_from_tag, d.corners, d.covariance});
    }
  }
  if (tags.empty()) {
    if (detections.empty()) add("no tag in the picture");
    if (!strangers.empty()) add("not in the map: " + join(strangers));
    track.reason = trouble;
    return track;
  }

  choose(solve_joint_pose(tags, lens_, last_), tags, time_ns, &track);
  if (track.pose) {
    std::vector<int> left_out;
    std::multiset<int> used(track.pose->tags.begin(), track.pose->tags.end());
    for (const TagObservation& tag : tags) {
      const auto found = used.find(tag.id);
      if (found == used.end())
        left_out.push_back(tag.id);
      else
        used.erase(found);
    }
    if (!left_out.empty()) add(join(left_out) + ": not where the map says");
  }
  if (!trouble.empty()) track.reason += (track.reason.empty() ? "" : "; ") + trouble;
  return track;
}

bool AprilTagTracker::within_reach(const FittedPose& fit, std::int64_t time_ns) const {
  const double seconds = 1e-9 * double(time_ns - last_time_ns_);
  return last_ && rotation_between(*last_, fit.pose) <= kReachRad + kReachRadPerS * seconds;
}

void AprilTagTracker::choose(const std::vector<FittedPose>& poses,
                             const std::vector<TagObservation>& tags, std::int64_t time_ns,
                             Track* track) const {
  std::vector<int> ids;
  for (const TagObservation& tag : tags) ids.push_back(tag.id);
  const double gate_px = consistency_gate_px(lens_);
  if (poses.empty() || !(poses.front().rms_px <= gate_px)) {
    track->reason = "no pose explains " + join(ids);
    return;
  }

  // The poses that cannot be ruled out, better first.
  const FittedPose& best = poses.front();
  const double variance = std::max(1.0, best.chi_square / std::max(1, best.degrees_of_freedom));
  bool contradiction = false;
  std::vector<const FittedPose*> plausible{&best};
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const FittedPose& rival = poses[i];
    const bool worse = best.rms_px <= settings_.ambiguity_ratio * rival.rms_px &&
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
    track->reason = join(ids) + " contradict each other in this map";
    return;
  }
  track->status = TrackStatus::ambiguous;
  track->reason = std::to_string(plausible.size()) + " poses explain " + join(ids) + " alike";
  for (const FittedPose* p : plausible) track->candidates.push_back(to_pose(*p, tags));
}

}  // namespace

std::unique_ptr<Tracker> make_apriltag_tracker(const set::Tracking& settings,
                                               const PinholeIntrinsics& intrinsics,
                                               const ResponseCurve& response) {
  return std::make_unique<AprilTagTracker>(settings, intrinsics, response);
}

}  // namespace previz::tracking
