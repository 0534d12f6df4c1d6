// The light camera's calibration: its lens on boards seen beyond 90 degrees, its pose by tags.
#include <glm/gtc/quaternion.hpp>

#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/lens/coverage.hpp"
#include "daemon/tools/calibrate/lens/fisheye.hpp"
#include "daemon/tools/calibrate/lens/light_pose.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "tests/support/calibrate_pictures.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::calibrate::fisheye_test {

using test::degree;

constexpr double noise_px = 0.2;

FisheyeIntrinsics wide_lens() {
  return {1280, 1024, 301, 300, 648, 505, {-0.02, 0.004, -0.003, 0.0004}, 105 * degree};
}

// A board held in a ring around the lens, its middle at this angle off axis.
Views ring(const std::vector<double>& off_axis_deg, int around, unsigned seed = 1) {
  const Board board = parse_board("chessboard:9x6:25mm");
  const Fisheye lens(wide_lens());
  std::mt19937 random(seed);
  Views views{lens.intrinsics().width, lens.intrinsics().height, {}};
  for (const double angle : off_axis_deg)
    for (int i = 0; i < around; ++i) {
      // Held upright before a camera that was turned towards it, then brought to the fisheye's
      // axes.
      const double azimuth = 2 * std::numbers::pi * (i + angle / 90) / around;
      const glm::dmat3 turned = glm::mat3_cast(
          glm::angleAxis(angle * degree, glm::dvec3(-std::sin(azimuth), std::cos(azimuth), 0)));
      const test::Lens through = [&](const glm::dvec3& point) {
        return lens.project(turned * point);
      };
      const test::Held held{
          25.0 * std::sin(3.0 * i), 25.0 * std::cos(2.0 * i), 20.0 * i, {0, 0, 0.22}};
      views.views.push_back(
          test::hold(board, {held}, through, views.width, views.height, noise_px, random).views[0]);
    }
  return views;
}

Views all_around(unsigned seed = 1) {
  return ring({15, 50, 80}, 8, seed);
}

TEST(FisheyeCalibration, ErrorsAreAsLargeAsStatedBeyond90Degrees) {
  const FisheyeIntrinsics lens = wide_lens();
  const std::vector<double> truth = {lens.fx,   lens.fy,   lens.cx,   lens.cy,
                                     lens.k[0], lens.k[1], lens.k[2], lens.k[3]};
  double squares = 0;
  constexpr int captures = 10;
  for (unsigned seed = 1; seed <= captures; ++seed) {
    const Views views = all_around(seed);
    const FisheyeFit fisheye = fit_fisheye(views);
    EXPECT_GT(fisheye.widest_corner_rad, 95 * degree);
    EXPECT_TRUE(missing_views(views, fisheye).empty());
    for (std::size_t p = 0; p < truth.size(); ++p) {
      const double z = (fisheye.fit.bundle.lens[p] - truth[p]) / fisheye.sigma[p];
      EXPECT_LT(std::abs(z), 5) << fisheye_parameters[p] << " seed " << seed;
      squares += z * z;
    }
  }
  // The mean of squares of unit normals, were the 8 of a capture one: 1 within 4 sqrt(2/10).
  EXPECT_LT(squares / (8 * captures), 1 + 4 * std::sqrt(2.0 / captures));
}

// What the calibration is for: rays. Where it says it can be trusted, a pixel's direction is right
// to what 1 px is there (1 / 300 rad), and much better.
TEST(FisheyeCalibration, RaysAreRightAsFarAsItIsTrusted) {
  const FisheyeFit fisheye = fit_fisheye(all_around());
  EXPECT_GT(fisheye.intrinsics.max_angle_rad, 90 * degree);
  EXPECT_LE(fisheye.intrinsics.max_angle_rad, fisheye.widest_corner_rad);
  const Fisheye truth(wide_lens()), found(fisheye.intrinsics);
  for (double angle = 0; angle < found.max_angle_rad(); angle += 5 * degree)
    for (double around = 0; around < 6; around += 0.7) {
      const glm::dvec3 ray(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around),
                           std::cos(angle));
      const auto back = found.unproject(*truth.project(ray));
      if (!back) continue;  // a pixel or less beyond what is trusted
      EXPECT_LT(glm::distance(*back, ray), 1.0 / 300) << angle / degree;
    }
}

TEST(FisheyeCalibration, WritesTheTableThatASetFileTakes) {
  const FisheyeFit fisheye = fit_fisheye(all_around());
  LightCameraCalibration camera;
  camera.intrinsics = fisheye.intrinsics;
  const glm::dmat4 pose = test::camera_looking({0.3, 0.1, 0.2}, {0.4, 0.2, 2});
  const set::Set set =
      set::parse_set(set::intrinsics_toml(camera) + set::light_pose_toml(pose), "printed.toml");
  ASSERT_TRUE(set.light_camera.calibration);
  const LightCameraCalibration& read = *set.light_camera.calibration;
  EXPECT_NEAR(read.intrinsics.fx, fisheye.intrinsics.fx, 1e-8);
  EXPECT_NEAR(read.intrinsics.k[3], fisheye.intrinsics.k[3], 1e-11);
  EXPECT_NEAR(read.intrinsics.max_angle_rad, fisheye.intrinsics.max_angle_rad, 1e-11);
  for (int c = 0; c < 4; ++c) EXPECT_LT(glm::distance(read.world_from_camera[c], pose[c]), 1e-10);
}

TEST(FisheyeCapture, AsksForTheEdgeOfTheCircle) {
  const Views views = ring({10, 30}, 8);
  const auto missing = missing_views(views, fit_fisheye(views));
  EXPECT_THAT(missing, ElementsAre(HasSubstr("near the edge of the image circle")));
}

TEST(FisheyeCapture, AsksForMoreViews) {
  const Views views = ring({60}, 4);
  const auto missing = missing_views(views, fit_fisheye(views));
  ASSERT_FALSE(missing.empty());
  EXPECT_THAT(missing[0], HasSubstr("more views: 4"));
}

// Tags on the inside of a room, as a fisheye sees them: 4x4 rays a pixel.
class TagRoom {
 public:
  explicit TagRoom(std::vector<set::Tag> tags) : tags_(std::move(tags)) {
    for (const set::Tag& tag : tags_) codes_.push_back(test::cells_of("tag36h11", tag.id));
  }

  FramePtr photograph(const FisheyeIntrinsics& intrinsics, const glm::dmat4& world_from_camera,
                      unsigned seed) const {
    const Fisheye lens(intrinsics);
    test::LinearPicture picture{intrinsics.width, intrinsics.height, {}};
    for (int y = 0; y < picture.height; ++y)
      for (int x = 0; x < picture.width; ++x) {
        double sum = 0;
        for (int s = 0; s < 16; ++s) {
          const int across = s % 4, down = s / 4;
          const auto ray = lens.unproject({x - 0.375 + 0.25 * across, y - 0.375 + 0.25 * down});
          if (ray) sum += radiance(world_from_camera, *ray) / 16;
        }
        picture.value.push_back(sum);
      }
    std::mt19937 random(seed);
    Frame frame = test::expose(picture, {.full_well_e = 20000, .response = {}}, random);
    frame.source = "light";
    return std::make_shared<const Frame>(std::move(frame));
  }

 private:
  double radiance(const glm::dmat4& world_from_camera, const glm::dvec3& ray) const {
    const glm::dvec3 origin(world_from_camera[3]), way = glm::dmat3(world_from_camera) * ray;
    for (std::size_t t = 0; t < tags_.size(); ++t) {
      const glm::dmat4& pose = tags_[t].world_from_tag;
      const glm::dvec3 normal(pose[2]), centre(pose[3]);
      const double along = glm::dot(normal, way);
      if (!(along < 0)) continue;
      const glm::dvec3 hit = origin + way * (glm::dot(normal, centre - origin) / along) - centre;
      if (!(glm::dot(hit + centre - origin, way) > 0)) continue;
      // The code's picture has a white ring of one cell around the black border (8 cells).
      const auto& [cells, border, code] = codes_[t];
      const double cell = tags_[t].size_m / border;
      const int x = int(std::floor(glm::dot(hit, glm::dvec3(pose[0])) / cell + 0.5 * cells));
      const int y = int(std::floor(-glm::dot(hit, glm::dvec3(pose[1])) / cell + 0.5 * cells));
      if (x >= 0 && y >= 0 && x < cells && y < cells)
        return code[std::size_t(y * cells + x)] ? 0.75 : 0.04;
    }
    return 0.75;
  }

  std::vector<set::Tag> tags_;
  std::vector<test::TagCells> codes_;
};

// Facing the camera from `direction` at a distance.
set::Tag facing(int id, const glm::dvec3& direction, double distance, double size_m) {
  const glm::dvec3 z = -glm::normalize(direction);
  const glm::dvec3 x = glm::normalize(glm::cross(glm::dvec3(0.1, 0.2, 1), z));
  return {id, size_m,
          glm::dmat4(glm::dvec4(x, 0), glm::dvec4(glm::cross(z, x), 0), glm::dvec4(z, 0),
                     glm::dvec4(-distance * z, 1))};
}

std::vector<set::Tag> room() {
  return {facing(0, {1, 0.2, 0.5}, 0.6, 0.16), facing(1, {-0.8, 0.5, 0.3}, 0.7, 0.16),
          facing(2, {0.1, -1, 0.05}, 0.6, 0.16), facing(3, {-0.2, 0.3, 1}, 0.8, 0.16)};
}

FisheyeIntrinsics small_lens() {
  return {640, 640, 180, 180, 319.5, 319.5, wide_lens().k, wide_lens().max_angle_rad};
}

glm::dmat4 true_pose() {
  return test::camera_looking({0.03, -0.02, 0.05}, {0.08, 0.03, 1}, {0, -1, 0});
}

set::Tracking tracking(std::vector<set::Tag> tags) {
  set::Tracking settings;
  settings.tags = std::move(tags);
  return settings;
}

// Tags all around, one of them straight across the axis (90 degrees off it).
TEST(LightPose, IsFoundByTagsAllAround) {
  test::Pictures picture({TagRoom(room()).photograph(small_lens(), true_pose(), 1)});
  const LightPose pose = find_light_pose(picture, small_lens(), {}, tracking(room()));
  EXPECT_EQ(pose.tags, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_TRUE(pose.left_out.empty());
  EXPECT_EQ(pose.pictures, 1);
  EXPECT_LT(pose.rms_px, 0.15);
  EXPECT_LT(pose.position_sigma_m, 0.001);
  EXPECT_LT(glm::distance(pose.world_from_camera[3], true_pose()[3]), 5 * pose.position_sigma_m);
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_LT(glm::distance(pose.world_from_camera[axis], true_pose()[axis]),
              5 * pose.rotation_sigma_rad);
}

TEST(LightPose, ATagThatWasMovedIsNamed) {
  test::Pictures picture({TagRoom(room()).photograph(small_lens(), true_pose(), 1)});
  auto believed = room();
  believed[1].world_from_tag[3].z += 0.05;
  const LightPose pose = find_light_pose(picture, small_lens(), {}, tracking(believed));
  EXPECT_EQ(pose.left_out, std::vector<int>{1});
  EXPECT_LT(glm::distance(pose.world_from_camera[3], true_pose()[3]), 0.002);
}

TEST(LightPose, OneTagIsNotEnough) {
  test::Pictures picture({TagRoom({room()[0]}).photograph(small_lens(), true_pose(), 1)});
  const std::string refusal =
      test::error_of([&] { find_light_pose(picture, small_lens(), {}, tracking(room())); });
  EXPECT_THAT(refusal, HasSubstr("only tag 0"));
}

}  // namespace previz::calibrate::fisheye_test
