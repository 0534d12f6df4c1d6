// The unseen part of the light filled with what the film camera saw there.
#include "daemon/core/lighting/observed.hpp"

#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/lighting/response.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/plate.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::observed_test {

using test::degree;

ObserverCalibration film_camera() {
  ObserverCalibration camera;
  camera.intrinsics = {120, 90, 80, 80, 59.5, 44.5, -0.1, 0.02, 0.001, 0, 0};
  return camera;  // sRGB
}

// A plate of a sky, at the pixels' centres; rays end on the box where there is one.
Plate film(const ObserverCalibration& camera, const glm::dmat4& pose, double exposure,
           const test::Sky& sky) {
  const PinholeIntrinsics& lens = camera.intrinsics;
  const Response response(camera.response, 8);
  Plate plate{lens.width, lens.height, 8, {}};
  for (int y = 0; y < lens.height; ++y)
    for (int x = 0; x < lens.width; ++x) {
      const glm::dvec2 n = undistort(lens, {x, y}).value();
      const glm::dvec3 direction = glm::normalize(glm::dmat3(pose) * glm::dvec3(n, 1));
      for (int c = 0; c < 3; ++c)
        plate.samples.push_back(response.forward(exposure * sky(direction)[c]));
    }
  return plate;
}

const test::Sky below = [](const glm::dvec3& d) { return 0.3 + 0.2 * d; };

// 8 bits of sRGB near 0.5 step by 0.8 %, of which rounding takes half; the sky's slope is 0.2 a
// radian and a texel of 256 reaches 0.8 degrees to its corner.
constexpr double tolerance = 0.004 + 0.2 * 0.8 * degree;

TEST(ObservedLight, KeepsWhatTheFilmCameraSawWhereItSawIt) {
  const ObserverCalibration camera = film_camera();
  ObservedLight light(camera, 1024, nullptr);
  EXPECT_EQ(light.map().size, 256);
  for (const glm::dmat4& pose : {test::looking(20, -40), test::looking(100, -60, 30)})
    light.see(film(camera, pose, 1.5, below), 1.5, pose);
  int seen = 0;
  for (int t = 0; t < 256 * 256; ++t) {
    if (light.map().seen[std::size_t(t)] == 0) continue;
    ++seen;
    const glm::dvec3 direction(texel_direction(256, t % 256, t / 256));
    ASSERT_LT(glm::length(glm::dvec3(light.map().radiance[std::size_t(t)]) - below(direction)),
              std::sqrt(3.0) * tolerance);
    // Within the picture's diagonal of one of the two.
    EXPECT_GT(std::max(glm::dot(direction, test::towards(20, -40)),
                       glm::dot(direction, test::towards(100, -60))),
              std::cos(46 * degree));
  }
  // 74 by 59 degrees are 1.1 sr; the two overlap by little.
  EXPECT_GT(seen * texel_sr(256), 1.6);
  EXPECT_LT(seen * texel_sr(256), 2.3);
}

TEST(ObservedLight, TheLastPictureCounts) {
  const ObserverCalibration camera = film_camera();
  const glm::dmat4 pose = test::looking(0, -30);
  ObservedLight light(camera, 64, nullptr);
  for (const double radiance : {0.1, 0.4}) {
    const auto grey = [radiance](const glm::dvec3&) { return glm::dvec3(radiance); };
    light.see(film(camera, pose, 2, grey), 2, pose);
  }
  const std::size_t there = texel_index(64, glm::vec3(test::towards(0, -30)));
  EXPECT_NEAR(light.map().radiance[there].g, 0.4, 0.4 * 0.006);
}

TEST(ObservedLight, RefusesPlatesOfAnotherSize) {
  ObservedLight light(film_camera(), 64, nullptr);
  EXPECT_THROW(light.see(Plate{2, 2, 8, std::vector<std::uint16_t>(12)}, 1, glm::dmat4(1)), Error);
}

// What the film camera sees of a wall lies elsewhere as seen from the set.
TEST(ObservedLight, IsSeenFromTheSetInARoom) {
  const ObserverCalibration camera = film_camera();
  const auto room = std::make_shared<const Room>(box_triangles(glm::dvec3(4), glm::dmat4(1)),
                                                 glm::dvec3(-1, 0, 0));
  const glm::dvec3 mark(2, 0.4, -0.3);  // on the wall at +X
  glm::dmat4 pose = test::looking(0, 0);
  pose[3] = glm::dvec4(0.5, 0.5, 0.2, 1);
  const test::Sky marked = [&](const glm::dvec3& d) {
    const glm::dvec3 from(pose[3]);
    const glm::dvec3 hit = from + (2 - from.x) / d.x * d;  // straight ahead only that wall is seen
    return glm::dvec3(glm::distance(hit, mark) < 0.2 ? 0.9 : 0.1);
  };
  ObservedLight light(camera, 256, room);
  light.see(film(camera, pose, 1, marked), 1, pose);
  glm::dvec3 bright(0);
  for (int t = 0; t < 256 * 256; ++t)
    if (light.map().radiance[static_cast<std::size_t>(t)].g > 0.5f)
      bright += glm::dvec3(texel_direction(256, t % 256, t / 256));
  const glm::dvec3 expected = glm::normalize(mark - glm::dvec3(-1, 0, 0));
  EXPECT_LT(std::acos(std::min(1.0, glm::dot(glm::normalize(bright), expected))), 0.3 * degree);
}

TEST(UnseenObserver, FillsWhatItSawAndContinuesTheEdgeElsewhere) {
  const LightCameraCalibration fisheye = test::fisheye_camera(128, test::looking(0, 90));
  const auto above = [](const glm::dvec3&) { return glm::dvec3(0.5); };
  const FramePtr frame = test::photograph(fisheye, above, 1);
  Estimator estimator(fisheye, test::unseen_as(set::UnseenRule::observer));
  const ObserverCalibration camera = film_camera();
  ObservedLight light(camera, estimator.resolution(), nullptr);
  const glm::dmat4 pose = test::looking(0, -50);
  light.see(film(camera, pose, 1.5, below), 1.5, pose);
  const Lighting lighting = estimator({&frame, 1}, &light);
  const EnvironmentMap& map = lighting.environment;
  const auto radiance = [&](double azimuth, double elevation) {
    return glm::dvec3(
        map.radiance[texel_index(map.size, glm::vec3(test::towards(azimuth, elevation)))]);
  };
  EXPECT_LT(glm::length(radiance(0, -50) - below(test::towards(0, -50))),
            std::sqrt(3.0) * tolerance);
  EXPECT_LT(glm::length(radiance(20, -40) - below(test::towards(20, -40))),
            std::sqrt(3.0) * tolerance);
  EXPECT_LT(glm::length(radiance(180, -30) - 0.5), 1e-3);  // the edge, continued
  EXPECT_LT(glm::length(radiance(0, 30) - 0.5), 1e-3);     // the light camera's own
  EXPECT_THAT(lighting.report.notes.back(), HasSubstr("not seen by the film camera either"));
}

}  // namespace previz::lighting::observed_test
