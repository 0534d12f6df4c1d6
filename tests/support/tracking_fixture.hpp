// What the tests of the whole tracker share: a table with tags, its pictures, and errors of poses.
#pragma once

#include <glm/gtc/quaternion.hpp>

#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::tracking {

using test::camera_looking;
using test::flat_tag;
using test::TagScene;

inline constexpr std::int64_t kFrameNs = 40'000'000;

inline TagScene table() {
  TagScene scene;
  scene.lens = test::plain_lens(480, 360, 450);
  scene.lens.k1 = -0.12, scene.lens.k2 = 0.04, scene.lens.p1 = 0.001, scene.lens.p2 = -0.0007;
  scene.tags = {flat_tag(0, 0.08, {0, 0, 0}), flat_tag(1, 0.08, {0.22, -0.05, 0}, 0.4),
                flat_tag(2, 0.08, {-0.18, 0.15, 0}, -0.3)};
  scene.world_from_camera = camera_looking({0.1, -0.6, 0.45}, {0.02, 0.03, 0});
  return scene;
}

inline set::Tracking settings_for(const TagScene& scene) {
  set::Tracking settings;
  settings.family = scene.family;
  settings.tags = scene.tags;
  return settings;
}

inline Frame picture(const TagScene& scene, std::mt19937& random, double full_well_e = 20000,
                     PixelFormat format = PixelFormat::rgb8) {
  return test::expose(test::render(scene),
                      {.full_well_e = full_well_e, .response = {}, .format = format}, random);
}

// What a new tracker finds in one picture of what is `seen`.
inline Track track_once(const set::Tracking& settings, const TagScene& seen, unsigned seed,
                        PixelFormat format = PixelFormat::rgb8) {
  std::mt19937 random(seed);
  return make_apriltag_tracker(settings, seen.lens)->track(picture(seen, random, 20000, format));
}

inline double angle_between(const glm::dmat4& a, const glm::dmat4& b) {
  glm::dquat q = glm::quat_cast(glm::transpose(glm::dmat3(a)) * glm::dmat3(b));
  return 2 * std::atan2(glm::length(glm::dvec3(q.x, q.y, q.z)), std::abs(q.w));
}

inline double distance(const glm::dmat4& a, const glm::dmat4& b) {
  return glm::distance(glm::dvec3(a[3]), glm::dvec3(b[3]));
}

inline double translation_sigma(const Pose& pose) {
  return std::sqrt(pose.covariance[21] + pose.covariance[28] + pose.covariance[35]);
}

inline double rotation_sigma(const Pose& pose) {
  return std::sqrt(pose.covariance[0] + pose.covariance[7] + pose.covariance[14]);
}

}  // namespace previz::tracking
