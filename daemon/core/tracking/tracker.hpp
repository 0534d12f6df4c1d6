// This is the interface of every tracking system: it reports where the camera is (P12).
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/core/tracking/tag_observation.hpp"
#include "drivers/frame.hpp"

namespace previz::tracking {

struct Pose {
  glm::dmat4 world_from_camera{1.0};  // OpenCV camera axes, metres
  // Row-major 6x6, rotation (rad) then translation (m), perturbation in the camera frame.
  std::array<double, 36> covariance{};
  double reprojection_rms_px = 0;
  std::vector<int> tags;  // ids used; empty if the tracker uses no tags
};

// The place of a carrier of the set.
struct CarrierPose {
  glm::dmat4 world_from_carrier{1.0};
  // As Pose::covariance, but in the carrier's frame; includes the error of the camera's pose.
  std::array<double, 36> covariance{};
  std::vector<int> tags;  // ids used
};
struct CarrierTrack {
  std::string name;
  std::optional<CarrierPose> pose;  // absent: carrier or camera not found in this frame
  std::string reason;               // as Track::reason
};

// A tag of the set whose corners cannot be used in a frame.
struct UnusableTag {
  int id = 0;
  std::string why;
};

enum class TrackStatus { tracked, ambiguous, lost };
const char* to_string(TrackStatus status);  // "tracked" and so on

struct Track {
  TrackStatus status = TrackStatus::lost;
  std::optional<Pose> pose;      // set only if tracked
  std::vector<Pose> candidates;  // ambiguous: both poses, likelier first
  // If lost or ambiguous, the reason in plain words. If tracked, which tags were left out and why,
  // if any.
  std::string reason;
  std::vector<int> seen_tags;  // every id detected, in the map or not, as often as it was; empty
                               // without tags
  // The tags of the stage that could be measured, used or not, and those that could not.
  std::vector<TagObservation> observations;
  std::vector<UnusableTag> unusable;
  std::vector<CarrierTrack> carriers;  // all of the set's
};

class Tracker {
 public:
  virtual ~Tracker() = default;
  // Returns where the camera was at the frame's time. A tracker that does not look through this
  // camera (a recorded track, FreeD, motion capture) only reads the frame's timestamp_ns and leaves
  // everything about tags empty. Frames come in capture order; a tracker may use the last pose.
  // Never throws for picture content.
  virtual Track track(const Frame& frame) = 0;
  // Uses these tags of the stage for no pose from now on, because they are not where the set has
  // them; they are still observed. Does nothing where there are no tags.
  virtual void leave_out(const std::set<int>& /*ids*/) {}
  // Forgets the last pose (after a cut or a seek).
  virtual void reset() = 0;
};

}  // namespace previz::tracking
