// Filters the camera's pose for the display: it jitters less, does not jump when other tags are
// seen, and does not go away while the tags are covered for a moment. Poses that are recorded,
// refined or rendered offline never pass through it.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <memory>
#include <optional>

#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// Where a picture shows the camera. Axes and covariance are as in Pose.
struct ShownPose {
  glm::dmat4 world_from_camera{1.0};
  std::array<double, 36> covariance{};
  double held_s = 0;  // time since the last tracked frame; 0: this frame was tracked
};

// This is an error-state Kalman filter on the rigid motions (Barfoot, State Estimation for
// Robotics, 8.2) whose camera keeps its velocity but for a white acceleration. How strong the
// acceleration is, is found from the poses: a pose that the filter did not expect, by more than
// pose_surprise, raises it at once, and it fades within a second. A camera at rest is therefore
// averaged over a second, and a moving one is followed. With S = P + R, the sum of the expected and
// the measured covariance, the surprise y' inv(S) y of a pose y off the expected one bounds two
// distances: the filtered pose is off the measured one by at most this in R, and off the expected
// one by at most this in P.
//
// A pose of other tags than before may also be off by what the map has wrong, of which its
// covariance knows nothing. If it is a surprise, but moves no tag by more than the tracker lets the
// map be wrong (consistency_gate_px), the filter takes it over as it is, and the difference is
// added to what is shown, from where it fades: the shown pose does not jump, but glides there
// within a second. Where a tag is in both pictures and all corners fit, the map is right, and the
// step is the camera's.
inline constexpr double pose_surprise = 16.8;  // 99 % of a chi-square of 6 degrees of freedom

class PoseFilter {
 public:
  PoseFilter(const set::Tracking& settings, const PinholeIntrinsics& lens);
  ~PoseFilter();

  // Returns where this frame's picture shows the camera; nothing: where its track says, which may
  // be nowhere. Frames come in the order of their times; after a pause of half a second, or of
  // settings.hold_s if that is longer, the filter begins anew. A frame that is not tracked is shown
  // with the expected pose for settings.hold_s, as long as the tags that were used last are likely
  // off by no more than settings.hold_error of the picture's width; the velocity then fades.
  std::optional<ShownPose> shown(const Track& track, std::int64_t time_ns);

  // Returns the pose that the filter expects at this time, and held_s is the time since the last
  // tracked frame; nothing if it knows none.
  std::optional<ShownPose> expected(std::int64_t time_ns) const;

 private:
  struct State;

  double seconds_to(std::int64_t time_ns) const;
  void begin(const Pose& pose, std::int64_t time_ns);
  void follow(const Pose& pose, std::int64_t time_ns);
  std::optional<ShownPose> held(std::int64_t time_ns);
  bool is_of_the_map(const glm::dmat4& expected, const Pose& pose) const;
  double likely_error(const ShownPose& pose) const;

  const set::Tracking settings_;
  const PinholeIntrinsics lens_;
  std::unique_ptr<State> state_;  // null: no pose is known
};

}  // namespace previz::tracking
