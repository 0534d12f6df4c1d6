// The joint pose on corners made by the test: exact recovery, covariance, moved tags, two poses.
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/tracking/joint_pose.hpp"
#include "tests/support/pose_error.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::tracking::pose_test {

using test::TagScene;

constexpr double kFloorPx = 0.03;  // kCornerFloorPx of joint_pose.cpp, part of the stated noise

std::vector<TagObservation> observe(const TagScene& scene, double sigma_px, std::mt19937& random) {
  std::normal_distribution<double> normal(0, sigma_px);
  std::vector<TagObservation> tags;
  for (const set::Tag& tag : scene.tags) {
    TagObservation o{tag.id, tag.size_m, tag.world_from_tag, test::exact_corners(scene, tag), {}};
    for (glm::dvec2& p : o.corners) p += glm::dvec2(normal(random), normal(random));
    const double rest = std::max(0.0, sigma_px * sigma_px - kFloorPx * kFloorPx);
    for (std::size_t i = 0; i < 8; ++i) o.covariance[9 * i] = rest;
    tags.push_back(o);
  }
  return tags;
}

TagScene three_tags() {
  TagScene scene;
  scene.lens = test::plain_lens(640, 480, 600);
  scene.lens.k1 = -0.12, scene.lens.k2 = 0.04, scene.lens.p1 = 0.001, scene.lens.p2 = -0.0007;
  scene.tags = {test::flat_tag(0, 0.08, {0, 0, 0}), test::flat_tag(1, 0.08, {0.25, -0.05, 0}, 0.4),
                test::flat_tag(2, 0.08, {-0.2, 0.2, 0}, -0.3)};
  scene.world_from_camera = test::camera_looking({0.1, -0.7, 0.5}, {0.02, 0.05, 0});
  return scene;
}

double distance_m(const FittedPose& fit, const glm::dmat4& truth) {
  return glm::distance(glm::dvec3(world_from_camera(fit.pose)[3]), glm::dvec3(truth[3]));
}

// Rounding alone: 1e-9 m at 1 m, at every scale and 1 km from the origin.
TEST(TrackingPose, ExactCornersGiveTheExactPose) {
  std::mt19937 random(1);
  for (double scale : {1e-3, 1.0, 1e3})
    for (double offset : {0.0, 1000.0}) {
      TagScene scene = three_tags();
      for (set::Tag& tag : scene.tags) {
        tag.size_m *= scale;
        tag.world_from_tag[3] =
            glm::dvec4(glm::dvec3(tag.world_from_tag[3]) * scale + glm::dvec3(offset), 1);
      }
      scene.world_from_camera[3] =
          glm::dvec4(glm::dvec3(scene.world_from_camera[3]) * scale + glm::dvec3(offset), 1);
      const auto poses = solve_joint_pose(observe(scene, 0, random), scene.lens, {});
      ASSERT_FALSE(poses.empty());
      // 1 km of offset leaves 1e-13 km of a coordinate, 1e-10 of the tags at scale 1e-3.
      const double tolerance = scale * 1e-8 + offset * 1e-11;
      EXPECT_LT(distance_m(poses[0], scene.world_from_camera), tolerance);
      EXPECT_EQ(poses[0].used.size(), 3u);
    }
}

// The normalised error squared of n trials has mean 6 and standard error sqrt(12/n). The covariance
// is never scaled below the stated noise, which makes it up to a fifth too large on average.
TEST(TrackingPose, CovarianceHolds) {
  for (double sigma : {0.05, 0.2, 0.5}) {
    TagScene scene = three_tags();
    std::mt19937 random(11);
    const int trials = 300;
    double sum = 0;
    for (int t = 0; t < trials; ++t) {
      const auto poses = solve_joint_pose(observe(scene, sigma, random), scene.lens, {});
      ASSERT_FALSE(poses.empty());
      sum += square_in_sigmas(poses[0].covariance, world_from_camera(poses[0].pose),
                              scene.world_from_camera);
    }
    const double spread = 3 * std::sqrt(12.0 / trials);
    EXPECT_LT(sum / trials, 6 + spread) << sigma;
    EXPECT_GT(sum / trials, 6 * 0.8 - spread) << sigma;
  }
}

// Noise beyond what the picture shows (a bent tag, a poor lens calibration) must widen it.
TEST(TrackingPose, CovarianceGrowsWithTheResiduals) {
  TagScene scene = three_tags();
  std::mt19937 random(12);
  const auto trace = [](const FittedPose& fit) {
    return fit.covariance[21] + fit.covariance[28] + fit.covariance[35];
  };
  auto good = observe(scene, 0.05, random);
  auto poor = observe(scene, 0.5, random);
  for (TagObservation& tag : poor) tag.covariance = good[0].covariance;
  const double a = trace(solve_joint_pose(good, scene.lens, {}).at(0));
  const double b = trace(solve_joint_pose(poor, scene.lens, {}).at(0));
  // (18 * 100 + 8) / 26 = 70 times in the mean; chi-square of 18 degrees rarely halves that.
  EXPECT_GT(b, 20 * a);
}

TEST(TrackingPose, AMovedTagIsLeftOut) {
  TagScene scene = three_tags();
  scene.tags.push_back(test::flat_tag(3, 0.08, {0.05, 0.25, 0}, 1.0));
  std::mt19937 random(3);
  for (double moved_m : {0.01, 0.05, 0.5}) {
    auto tags = observe(scene, 0.05, random);
    tags[1].world_from_tag[3].x += moved_m;
    const auto poses = solve_joint_pose(tags, scene.lens, {});
    ASSERT_FALSE(poses.empty());
    EXPECT_EQ(poses[0].used, (std::vector<std::size_t>{0, 2, 3})) << moved_m;
    EXPECT_LT(distance_m(poses[0], scene.world_from_camera), 0.003);
  }
}

TEST(TrackingPose, TwoTagsAtOddsAreAContradiction) {
  TagScene scene = three_tags();
  scene.tags.pop_back();
  std::mt19937 random(4);
  auto tags = observe(scene, 0.05, random);
  tags[1].world_from_tag[3].x += 0.1;
  const auto poses = solve_joint_pose(tags, scene.lens, {});
  const auto explains = [&](std::size_t tag) {
    return std::any_of(poses.begin(), poses.end(), [&](const FittedPose& fit) {
      return fit.used == std::vector<std::size_t>{tag} && fit.rms_px < 0.2;
    });
  };
  EXPECT_TRUE(explains(0));
  EXPECT_TRUE(explains(1));
}

TEST(TrackingPose, BothPosesOfASingleTagAreKept) {
  TagScene scene;
  scene.lens = test::plain_lens(640, 480, 600);
  scene.tags = {test::flat_tag(0, 0.08, {0, 0, 0})};
  scene.world_from_camera = test::camera_looking({0.25, -0.1, 1.0}, {0, 0, 0}, {0, 1, 0});
  std::mt19937 random(5);
  const auto poses = solve_joint_pose(observe(scene, 0.05, random), scene.lens, {});
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_LE(poses[0].chi_square, poses[1].chi_square);
  // The other one mirrors the tilt of 15 degrees about the line of sight.
  EXPECT_GT(rotation_between(poses[0].pose, poses[1].pose), 0.3);
}

TEST(TrackingPose, NoTagsNoPose) {
  EXPECT_TRUE(solve_joint_pose({}, test::plain_lens(64, 48, 60), {}).empty());
}

TEST(TrackingPose, ImpossibleCornersAreRefused) {
  const PinholeIntrinsics lens = test::plain_lens(640, 480, 600);
  TagObservation tag{0, 0.1, glm::dmat4(1.0), {{{0, 0}, {0, 0}, {0, 0}, {0, 0}}}, {}};
  for (const FittedPose& fit : solve_joint_pose({tag}, lens, {}))
    EXPECT_TRUE(std::isfinite(fit.rms_px));
  tag.corners = {{{100, 100}, {100, 200}, {200, 200}, {200, 100}}};  // mirrored: seen from behind
  for (const FittedPose& fit : solve_joint_pose({tag}, lens, {})) EXPECT_GT(fit.rms_px, 2);
}

}  // namespace previz::tracking::pose_test
