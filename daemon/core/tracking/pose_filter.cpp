#include "daemon/core/tracking/pose_filter.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <opencv2/core.hpp>

#include "daemon/core/tracking/joint_pose.hpp"

namespace previz::tracking {
namespace {

using Step6 = cv::Matx<double, 6, 1>;  // rotation (rad), then translation (m), camera axes
using Spread6 = cv::Matx<double, 6, 6>;
using Spread12 = cv::Matx<double, 12, 12>;

constexpr double kLongestGapS = 0.5;  // an older pose says nothing about this frame
constexpr double kFirstSpeed = 0.5;   // standard deviation before it is measured; rad/s, m/s
// Spectral density of the acceleration, rad^2/s^3 and m^2/s^3: of a camera that stands, of a hand
// (0.5 m/s^2 for a tenth of a second is 0.05), and of a whipped camera.
constexpr double kLeastPush = 1e-8, kFirstPush = 1e-3, kMostPush = 10;
constexpr double kPushFadesS = 0.065;     // by a factor of e
constexpr double kStirFadesS = 1.0;       // likewise, of what is feared while nothing is seen
constexpr double kGlideS = 0.3;           // likewise, of what other tags have changed
constexpr double kVelocityFadesS = 0.25;  // likewise, while nothing is seen
// A tag's wrong place moves the pose, and what the pose does not take up is seen in how the corners
// fit. Another tag's corners resist a turn by half its size: where the two are eight sizes apart, a
// sixteenth of the mistake is seen.
constexpr double kMistakePerFit = 16;
constexpr double kLeastDeviation = 1e-7;  // of a measured pose, rad and m

glm::dmat3 cross_matrix(const glm::dvec3& w) {
  return {0, w.z, -w.y, -w.z, 0, w.x, w.y, -w.x, 0};
}

glm::dmat4 rigid(const glm::dmat3& rotation, const glm::dvec3& translation) {
  glm::dmat4 result(rotation);
  result[3] = glm::dvec4(translation, 1);
  return result;
}

glm::dmat3 turned_by(const glm::dvec3& w) {
  const double angle = glm::length(w);
  return angle > 0 ? glm::mat3_cast(glm::angleAxis(angle, w / angle)) : glm::dmat3(1);
}

// The small motion with this rotation and translation.
glm::dmat4 step_motion(const Step6& d) {
  return rigid(turned_by({d(0), d(1), d(2)}), {d(3), d(4), d(5)});
}

// The motion of a camera that keeps its twist (angular, then linear velocity, camera axes) for a
// unit of time: the exponential of se(3).
glm::dmat4 screw_motion(const Step6& twist) {
  const glm::dvec3 w(twist(0), twist(1), twist(2)), v(twist(3), twist(4), twist(5));
  const double angle = glm::length(w);
  const glm::dmat3 k = cross_matrix(w);
  const glm::dmat3 along = angle > 1e-6
                               ? glm::dmat3(1) + (1 - std::cos(angle)) / (angle * angle) * k +
                                     (angle - std::sin(angle)) / (angle * angle * angle) * (k * k)
                               : glm::dmat3(1) + 0.5 * k;
  return rigid(turned_by(w), along * v);
}

// The small motion d with to = from * step_motion(d).
Step6 step_between(const glm::dmat4& from, const glm::dmat4& to) {
  const glm::dmat3 back = glm::transpose(glm::dmat3(from));
  glm::dquat q = glm::normalize(glm::quat_cast(back * glm::dmat3(to)));
  if (q.w < 0) q = -q;
  const glm::dvec3 axis(q.x, q.y, q.z);
  const double sine = glm::length(axis);
  const glm::dvec3 w = sine > 0 ? axis * (2 * std::atan2(sine, q.w) / sine) : 2.0 * axis;
  const glm::dvec3 v = back * glm::dvec3(to[3] - from[3]);
  return {w.x, w.y, w.z, v.x, v.y, v.z};
}

// The matrix that brings a small motion through `motion`: inverse(motion) * step_motion(d) * motion
// = step_motion(A d).
Spread6 brought_through(const glm::dmat4& motion) {
  const glm::dmat3 back = glm::transpose(glm::dmat3(motion));
  const glm::dmat3 moment = back * -cross_matrix(glm::dvec3(motion[3]));
  Spread6 result = Spread6::zeros();
  for (int column = 0; column < 3; ++column)
    for (int row = 0; row < 3; ++row) {
      result(row, column) = result(row + 3, column + 3) = back[column][row];
      result(row + 3, column) = moment[column][row];
    }
  return result;
}

Spread6 pose_part(const Spread12& spread) {
  return spread.get_minor<6, 6>(0, 0);
}

double surprise(const Step6& step, const Spread6& spread) {
  return step.dot(spread.solve(step, cv::DECOMP_CHOLESKY));
}

}  // namespace

struct PoseFilter::State {
  std::int64_t time_ns = 0;  // of the last tracked frame
  std::vector<int> tags;     // that it used
  double fit_px = 0;         // how far their corners were off the pose's, rms
  glm::dmat4 world_from_camera{1.0};
  Step6 twist = Step6::zeros();
  Spread12 spread = Spread12::zeros();  // of pose and twist
  double push = kFirstPush;             // spectral density of the acceleration
  double stir = kFirstPush;             // the most of it in the last second or so
  Step6 glide = Step6::zeros();         // from the pose to what is shown
  bool holds = false;                   // frames came since that were not tracked

  ShownPose shown() const;
  // Corrects the state by a measured pose that is `step` off it.
  void correct(const Step6& step, const Spread6& measured);
  // Puts the pose where it was measured; what is shown stays where it is.
  void take_over(const glm::dmat4& pose, const Spread6& measured);
  // Returns the state after so many seconds without a measurement.
  State after(double seconds) const;
  // Adds the pose's uncertainty by an acceleration of density `more` over these seconds.
  static void add_push(Spread12& spread, double more, double seconds);
};

void PoseFilter::State::add_push(Spread12& spread, double more, double seconds) {
  for (int i = 0; i < 6; ++i) {
    spread(i, i) += more * seconds * seconds * seconds / 3;
    spread(i, i + 6) += more * seconds * seconds / 2;
    spread(i + 6, i) += more * seconds * seconds / 2;
    spread(i + 6, i + 6) += more * seconds;
  }
}

ShownPose PoseFilter::State::shown() const {
  ShownPose result{world_from_camera * step_motion(glide), {}, 0};
  std::copy_n(pose_part(spread).val, 36, result.covariance.begin());
  return result;
}

PoseFilter::State PoseFilter::State::after(double seconds) const {
  State next = *this;
  const double kept = holds ? std::exp(-seconds / kVelocityFadesS) : 1;
  const double moving_s = holds ? kVelocityFadesS * (1 - kept) : seconds;
  const glm::dmat4 motion = screw_motion(twist * moving_s);
  next.world_from_camera = world_from_camera * motion;
  next.twist = twist * kept;
  next.glide = glide * std::exp(-seconds / kGlideS);

  Spread12 f = Spread12::zeros();
  const Spread6 brought = brought_through(motion);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) f(i, j) = brought(i, j);
    f(i, i + 6) = moving_s;
    f(i + 6, i + 6) = kept;
  }
  next.spread = f * spread * f.t();
  add_push(next.spread, holds ? stir : push, seconds);
  return next;
}

void PoseFilter::State::correct(const Step6& step, const Spread6& measured) {
  const cv::Matx<double, 12, 6> known = spread.get_minor<12, 6>(0, 0);
  const cv::Matx<double, 12, 6> gain =
      known * (pose_part(spread) + measured).inv(cv::DECOMP_CHOLESKY);
  const cv::Matx<double, 12, 1> correction = gain * step;
  spread = spread - gain * known.t();
  spread = (spread + spread.t()) * 0.5;
  const glm::dmat4 moved = world_from_camera * step_motion(correction.get_minor<6, 1>(0, 0));
  world_from_camera = rigid(glm::mat3_cast(glm::normalize(glm::quat_cast(glm::dmat3(moved)))),
                            glm::dvec3(moved[3]));
  twist = twist + correction.get_minor<6, 1>(6, 0);
}

void PoseFilter::State::take_over(const glm::dmat4& pose, const Spread6& measured) {
  glide = step_between(pose, world_from_camera * step_motion(glide));
  world_from_camera = pose;
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) {
      spread(i, j) = measured(i, j);
      spread(i, j + 6) = spread(i + 6, j) = 0;
    }
}

PoseFilter::PoseFilter(const set::Tracking& settings, const PinholeIntrinsics& lens)
    : settings_(settings), lens_(lens) {}

PoseFilter::~PoseFilter() = default;

double PoseFilter::seconds_to(std::int64_t time_ns) const {
  return 1e-9 * static_cast<double>(time_ns - state_->time_ns);
}

std::optional<ShownPose> PoseFilter::shown(const Track& track, std::int64_t time_ns) {
  if (!track.pose) return held(time_ns);
  follow(*track.pose, time_ns);
  if (!settings_.smooth) return std::nullopt;
  return state_->shown();
}

std::optional<ShownPose> PoseFilter::expected(std::int64_t time_ns) const {
  if (!state_) return std::nullopt;
  const double seconds = seconds_to(time_ns);
  ShownPose shown = state_->after(seconds).shown();
  shown.held_s = seconds;
  return shown;
}

void PoseFilter::begin(const Pose& pose, std::int64_t time_ns) {
  state_ = std::make_unique<State>();
  state_->time_ns = time_ns;
  state_->tags = pose.tags;
  state_->fit_px = pose.reprojection_rms_px;
  state_->world_from_camera = pose.world_from_camera;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j)
      state_->spread(i, j) = pose.covariance[static_cast<std::size_t>(6 * i + j)];
    state_->spread(i + 6, i + 6) = kFirstSpeed * kFirstSpeed;
  }
}

void PoseFilter::follow(const Pose& pose, std::int64_t time_ns) {
  const double seconds = state_ ? seconds_to(time_ns) : 0;
  if (!(seconds > 0 && seconds <= std::max(kLongestGapS, settings_.hold_s)))
    return begin(pose, time_ns);

  State next = state_->after(seconds);
  next.push = std::max(kLeastPush, next.push * std::exp(-seconds / kPushFadesS));
  Spread6 measured(pose.covariance.data());
  for (int i = 0; i < 6; ++i) measured(i, i) += kLeastDeviation * kLeastDeviation;
  const Step6 step = step_between(next.world_from_camera, pose.world_from_camera);
  const auto is_surprise = [&] {
    return !(surprise(step, pose_part(next.spread) + measured) <= pose_surprise);
  };
  if (next.tags != pose.tags && is_surprise() && is_of_the_map(next.world_from_camera, pose)) {
    next.take_over(pose.world_from_camera, measured);
  } else {
    while (is_surprise()) {
      if (!(next.push < kMostPush)) return begin(pose, time_ns);  // a cut, or a broken covariance
      State::add_push(next.spread, 0.5 * next.push, seconds);
      next.push *= 1.5;
    }
    next.correct(step, measured);
  }
  next.stir = std::max(next.push, next.stir * std::exp(-seconds / kStirFadesS));
  next.time_ns = time_ns;
  next.tags = pose.tags;
  next.fit_px = pose.reprojection_rms_px;
  next.holds = false;
  *state_ = std::move(next);
}

std::optional<ShownPose> PoseFilter::held(std::int64_t time_ns) {
  if (!state_) return std::nullopt;
  const double seconds = seconds_to(time_ns);
  if (!(seconds > 0 && seconds <= settings_.hold_s)) return std::nullopt;
  state_->holds = true;
  std::optional<ShownPose> pose = expected(time_ns);
  if (!(likely_error(*pose) <= settings_.hold_error * lens_.width)) return std::nullopt;
  return pose;
}

// Returns true if the step from the expected pose moves no tag that was used by more than the map
// may be wrong. Where both pictures have a tag in common, the fit of their corners bounds how
// wrong.
bool PoseFilter::is_of_the_map(const glm::dmat4& expected, const Pose& pose) const {
  const CameraFromWorld from = camera_from_world(expected);
  const CameraFromWorld to = camera_from_world(pose.world_from_camera);
  const bool share_a_tag =
      std::ranges::find_first_of(state_->tags, pose.tags) != state_->tags.end();
  const double shown_px = std::max(state_->fit_px, pose.reprojection_rms_px);
  const double gate_px =
      std::min(consistency_gate_px(lens_), share_a_tag ? kMistakePerFit * shown_px : HUGE_VAL);
  return std::ranges::all_of(settings_.tags, [&](const set::Tag& tag) {
    if (std::ranges::find(pose.tags, tag.id) == pose.tags.end()) return true;
    const glm::dvec3 middle(tag.world_from_tag[3]);
    const glm::dvec3 a = from.rotation * middle + from.translation;
    const glm::dvec3 b = to.rotation * middle + to.translation;
    return a.z > 0 && b.z > 0 &&
           std::hypot(lens_.fx * (a.x / a.z - b.x / b.z), lens_.fy * (a.y / a.z - b.y / b.z)) <=
               gate_px;
  });
}

// Returns the standard deviation of where the middles of the tags that were used last are in the
// picture, px, without the lens's distortion.
double PoseFilter::likely_error(const ShownPose& pose) const {
  const Spread6 spread(pose.covariance.data());
  const glm::dmat4 camera_from_world = glm::inverse(pose.world_from_camera);
  double variance = 0;
  int count = 0;
  for (const set::Tag& tag : settings_.tags) {
    if (std::ranges::find(state_->tags, tag.id) == state_->tags.end()) continue;
    const glm::dvec3 x(camera_from_world * tag.world_from_tag[3]);
    if (!(x.z > 0)) continue;
    const glm::dvec3 by_place[2] = {glm::dvec3(lens_.fx, 0, -lens_.fx * x.x / x.z) / x.z,
                                    glm::dvec3(0, lens_.fy, -lens_.fy * x.y / x.z) / x.z};
    for (const glm::dvec3& g : by_place) {
      // The point moves by x cross w for a rotation w of the camera, by -v for a translation v.
      const glm::dvec3 turn = glm::cross(g, x);
      const Step6 by_pose(turn.x, turn.y, turn.z, -g.x, -g.y, -g.z);
      variance += by_pose.dot(spread * by_pose);
    }
    ++count;
  }
  return count > 0 ? std::sqrt(variance / count) : HUGE_VAL;
}

}  // namespace previz::tracking
