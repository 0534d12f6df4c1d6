// From made-up skies through made-up fisheye pictures to the map, and back to the sky.
#include "daemon/core/lighting/lighting.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::estimate_test {

using std::numbers::pi;
using test::degree;
using test::fisheye_camera;
using test::looking;
using test::make_frame;
using test::photograph;
using test::Sky;
using test::towards;
using test::unseen_as;

// A pixel's diagonal on the axis: what is closer than this to an edge may be mixed with it.
constexpr double pixel_diagonal_rad = 1.5 / 153.3;

double cap_sr(double radius_rad) {
  return 2 * pi * (1 - std::cos(radius_rad));
}

const Sky uniform = [](const glm::dvec3&) { return glm::dvec3(1, 2, 3); };

set::Lighting constant_fill(double radiance) {
  return unseen_as(set::UnseenRule::constant, radiance);
}

Lighting estimate_one(const LightCameraCalibration& camera, const Sky& sky, double exposure,
                      const set::Lighting& settings) {
  const FramePtr frame = photograph(camera, sky, exposure);
  return estimate({&frame, 1}, camera, settings);
}

template <typename Body>  // body(direction, radiance, angle to `axis` in rad)
void for_each_texel(const EnvironmentMap& map, const glm::dvec3& axis, const Body& body) {
  lighting::for_each_texel(map, [&](const glm::dvec3& direction, const glm::dvec3& radiance) {
    body(direction, radiance, std::acos(std::clamp(glm::dot(direction, axis), -1.0, 1.0)));
  });
}

// The light of `uniform`, to half a code of a quarter of it.
void expect_uniform(const EnvironmentMap& map) {
  for (const glm::vec3& radiance : map.radiance)
    ASSERT_LT(glm::length(radiance - glm::vec3(1, 2, 3)), 2e-4f);
}

TEST(Estimate, UniformSkyIsUniformWhereSeen) {
  LightCameraCalibration camera = fisheye_camera();
  const FramePtr frame = photograph(camera, uniform, 0.25);
  for (const glm::dmat4& pose : {looking(0, 90), looking(40, 90, 30), looking(-70, 20, 10),
                                 looking(160, -35), looking(10, -90)}) {
    camera.world_from_camera = pose;
    const Lighting lighting = estimate({&frame, 1}, camera, constant_fill(9));
    ASSERT_EQ(lighting.environment.size, 1024);
    const double texel_diagonal = 2 * std::sqrt(texel_sr(1024));
    for_each_texel(lighting.environment, glm::dvec3(pose[2]),
                   [&](const glm::dvec3&, const glm::dvec3& radiance, double angle) {
                     // Half a code of 0.25 is 3e-5 of it. Only whole pixels count as seen.
                     if (angle < 100 * degree - texel_diagonal - pixel_diagonal_rad) {
                       ASSERT_LT(glm::length(radiance - glm::dvec3(1, 2, 3)), 2e-4);
                     } else if (angle > 100 * degree + texel_diagonal) {
                       ASSERT_EQ(radiance, glm::dvec3(9));
                     }
                   });
    EXPECT_LT(lighting.report.seen_sr, cap_sr(100 * degree));
    EXPECT_GT(lighting.report.seen_sr, cap_sr(100 * degree - pixel_diagonal_rad));
    EXPECT_NEAR(lighting.report.seen_sr + lighting.report.filled_sr, 4 * pi, 1e-6);
    EXPECT_EQ(lighting.report.overexposed_sr, 0);
  }
}

TEST(Estimate, OneTexelHoldsTheWholeSphere) {
  const LightCameraCalibration camera = fisheye_camera();
  const FramePtr frame = photograph(camera, uniform, 0.25);
  set::Lighting settings = constant_fill(9);
  settings.resolution = 1;
  const Lighting lighting = estimate({&frame, 1}, camera, settings);
  ASSERT_EQ(lighting.environment.radiance.size(), 1u);
  const double seen = lighting.report.seen_sr / (4 * pi);
  EXPECT_NEAR(seen, 0.5 * (1 - std::cos(100 * degree)), 0.01);
  EXPECT_NEAR(lighting.environment.radiance[0].g, 2 * seen + 9 * (1 - seen), 1e-3);
}

// Discs of 2 degrees radius: flux within 1 % and direction within a tenth of a degree, wherever
// they stand, on the map's folds and poles too, at any resolution.
TEST(Estimate, LampsKeepFluxAndDirection) {
  constexpr double radius = 2 * degree, lamp = 300, ambient = 0.05;
  const double solid_angle = cap_sr(radius);
  std::vector<glm::dvec3> places;
  for (const auto& [azimuth, elevation] : {std::pair{0.0, 90.0},
                                           {33.0, 78.0},
                                           {128.0, 52.0},
                                           {25.0, 38.0},
                                           {-90.0, 0.5},
                                           {45.0, -1.0},
                                           {200.0, -5.0},
                                           {-60.0, 12.0}})
    places.push_back(towards(azimuth, elevation));
  const Sky sky = [&](const glm::dvec3& d) {
    for (const glm::dvec3& place : places)
      if (glm::length(d - place) < 2 * std::sin(radius / 2)) return glm::dvec3(lamp);
    return glm::dvec3(ambient);
  };
  const LightCameraCalibration camera = fisheye_camera(512, looking(17, 90));
  const std::vector<FramePtr> frames{photograph(camera, sky, 0.8 / 256, test::Detail::fine),
                                     photograph(camera, sky, 0.8, test::Detail::fine)};
  for (int resolution : {0, 256, 64}) {
    set::Lighting settings = constant_fill(ambient);
    settings.resolution = resolution;
    const EnvironmentMap map = estimate(frames, camera, settings).environment;
    // The cap reaches a pixel's and a texel's diagonal beyond the lamp.
    const double reach = radius + pixel_diagonal_rad + 2 * std::sqrt(texel_sr(map.size));
    for (const glm::dvec3& place : places) {
      glm::dvec3 moment(0);
      double flux = 0;
      for_each_texel(map, place,
                     [&](const glm::dvec3& direction, const glm::dvec3& radiance, double angle) {
                       if (angle > reach) return;
                       flux += (radiance.g - ambient) * texel_sr(map.size);
                       moment += (radiance.g - ambient) * direction;
                     });
      EXPECT_NEAR(flux / (solid_angle * (lamp - ambient)), 1, 0.01)
          << place.x << " " << place.y << " " << place.z << " at " << map.size;
      // Texels of a coarse map are wider than the lamp; their centre of gravity is still known to a
      // fraction of them.
      const double limit = 0.1 * degree + (resolution == 64 ? 0.3 * std::sqrt(texel_sr(64)) : 0);
      EXPECT_LT(std::acos(std::min(1.0, glm::dot(glm::normalize(moment), place))), limit)
          << place.x << " " << place.y << " " << place.z << " at " << map.size;
    }
  }
}

// Axes may not be swapped or mirrored: a sky that names each direction comes back as itself.
TEST(Estimate, DirectionsAreWhereTheyWere) {
  const Sky sky = [](const glm::dvec3& d) { return 0.5 * d + 0.5; };
  for (const glm::dmat4& pose : {looking(0, 90), looking(30, 90, 45), looking(-100, 25, -20)}) {
    const LightCameraCalibration camera = fisheye_camera(512, pose);
    const EnvironmentMap map = estimate_one(camera, sky, 0.9, constant_fill(0)).environment;
    for_each_texel(map, glm::dvec3(pose[2]),
                   [&](const glm::dvec3& direction, const glm::dvec3& radiance, double angle) {
                     // The sky's slope is 1/2; a direction takes its pixel's mean.
                     if (angle < 99 * degree) {
                       ASSERT_LT(glm::length(radiance - (0.5 * direction + 0.5)),
                                 0.5 * pixel_diagonal_rad);
                     }
                   });
  }
}

TEST(Estimate, ReportsClippedAndBlackSolidAngles) {
  const glm::dvec3 lamp = towards(10, 60), hole = towards(-120, 45);
  const Sky sky = [&](const glm::dvec3& d) {
    if (glm::dot(d, lamp) > std::cos(5 * degree)) return glm::dvec3(0.5, 100, 0.5);
    if (glm::dot(d, hole) > std::cos(10 * degree)) return glm::dvec3(0);
    return glm::dvec3(0.5);
  };
  const LightCameraCalibration camera = fisheye_camera(512, looking(0, 90));
  const EnvironmentReport report = estimate_one(camera, sky, 1, constant_fill(0)).report;
  // Any pixel that the lamp clips when it covers a hundredth of it is counted: up to a pixel's
  // diagonal more. Holes count where a pixel lies wholly inside.
  EXPECT_GT(report.overexposed_sr, cap_sr(5 * degree) * 0.999);
  EXPECT_LT(report.overexposed_sr, cap_sr(5 * degree + pixel_diagonal_rad));
  EXPECT_LT(report.underexposed_sr, cap_sr(10 * degree) * 1.001);
  EXPECT_GT(report.underexposed_sr, cap_sr(10 * degree - pixel_diagonal_rad));
  ASSERT_GE(report.notes.size(), 3u);
  EXPECT_THAT(report.notes[0], HasSubstr("clipped in every exposure"));
  EXPECT_THAT(report.notes[1], HasSubstr("black in every exposure"));
  EXPECT_THAT(report.notes[2], HasSubstr("\"constant\""));
}

// A cap of half angle r has a solid angle of 2 pi (1 - cos r).
TEST(AreaWords, AreDegreesOrAShareOfAllDirections) {
  EXPECT_EQ(area_words(cap_sr(2 * degree)), "an area 4.0 degrees wide");
  EXPECT_EQ(area_words(pi), "an area of 25 % of all directions");
  EXPECT_EQ(area_words(4 * pi), "an area of 100 % of all directions");
}

TEST(UnseenHorizon, ContinuesAUniformSky) {
  for (const glm::dmat4& pose : {looking(0, 90), looking(50, 10)}) {
    const LightCameraCalibration camera = fisheye_camera(512, pose);
    const Lighting lighting =
        estimate_one(camera, uniform, 0.25, unseen_as(set::UnseenRule::horizon));
    expect_uniform(lighting.environment);
  }
}

TEST(UnseenHorizon, FollowsTheAzimuthAndCalmsDown) {
  const Sky sky = [](const glm::dvec3& d) {
    return glm::dvec3(1 + 0.5 * d.x / std::max(1e-9, std::hypot(d.x, d.y)));
  };
  const LightCameraCalibration camera = fisheye_camera(512, looking(20, 90));
  const EnvironmentMap map =
      estimate_one(camera, sky, 0.5, unseen_as(set::UnseenRule::horizon)).environment;
  const auto at = [&](double azimuth, double elevation) {
    return map.radiance[texel_index(map.size, glm::vec3(towards(azimuth, elevation)))].r;
  };
  // Sectors of 5 degrees: the chord of a cosine is off by (2.5 deg)^2 / 2, its mean by a third.
  for (double azimuth : {0.0, 45.0, 90.0, 180.0, -77.0}) {
    EXPECT_NEAR(at(azimuth, -10.5), 1 + 0.5 * std::cos(azimuth * degree), 0.003);
    const double t = (140.0 - 100.0) / 80.0;  // half way down
    EXPECT_NEAR(at(azimuth, -50), 1 + 0.5 * std::cos(azimuth * degree) * (1 - t * t * (3 - 2 * t)),
                0.004);
    EXPECT_NEAR(at(azimuth, -90), 1, 0.003);
  }
}

TEST(UnseenHorizon, DoesNotSmearALampAtTheEdge) {
  const glm::dvec3 lamp = towards(70, -4);
  const Sky sky = [&](const glm::dvec3& d) {
    return glm::dvec3(glm::dot(d, lamp) > std::cos(1.5 * degree) ? 1000.0 : 0.25);
  };
  const LightCameraCalibration camera = fisheye_camera(512, looking(0, 90));
  const std::vector<FramePtr> frames{photograph(camera, sky, 1, test::Detail::fine),
                                     photograph(camera, sky, 5e-4, test::Detail::fine)};
  const Lighting lighting = estimate(frames, camera, unseen_as(set::UnseenRule::horizon));
  for_each_texel(lighting.environment, glm::dvec3(0, 0, 1),
                 [&](const glm::dvec3&, const glm::dvec3& radiance, double angle) {
                   // Pixels on the lamp's rim of up to eight times the median may remain.
                   if (angle > 101 * degree) {
                     ASSERT_LT(radiance.r, 0.3);
                   }
                 });
  EXPECT_THAT(lighting.report.notes.back(), HasSubstr("8 times as bright as its median"));
}

TEST(UnseenMirror, ShowsTheUpperHalfBelow) {
  const Sky sky = [](const glm::dvec3& d) { return 0.4 * d + 0.5; };
  for (const glm::dmat4& pose : {looking(0, 90, 25), looking(30, 20)}) {
    const LightCameraCalibration camera = fisheye_camera(512, pose);
    const glm::dvec3 axis(pose[2]);
    const Lighting lighting = estimate_one(camera, sky, 0.9, unseen_as(set::UnseenRule::mirror));
    for_each_texel(lighting.environment, axis,
                   [&](const glm::dvec3& d, const glm::dvec3& radiance, double angle) {
                     if (angle < 101 * degree) return;
                     const glm::dvec3 mirrored = d - 2 * glm::dot(d, axis) * axis;
                     ASSERT_LT(glm::length(radiance - sky(mirrored)), 0.5 * pixel_diagonal_rad);
                   });
  }
}

TEST(UnseenMirror, FallsBackToTheHorizonWhereTheMirrorIsUnseenToo) {
  LightCameraCalibration camera = fisheye_camera(512, looking(0, 90));
  camera.intrinsics.max_angle_rad = 80 * degree;
  const Lighting lighting = estimate_one(camera, uniform, 0.25, unseen_as(set::UnseenRule::mirror));
  expect_uniform(lighting.environment);
  EXPECT_THAT(lighting.report.notes.back(), HasSubstr("not in the mirrored picture either"));
}

// A lens whose circle is wider than the picture: the edge is where the picture ends.
TEST(Estimate, ThePictureMayCutTheCircle) {
  LightCameraCalibration camera = fisheye_camera(512, looking(0, 90));
  camera.intrinsics.width = 400;
  camera.intrinsics.cx = 190;
  const Lighting lighting =
      estimate_one(camera, uniform, 0.25, unseen_as(set::UnseenRule::horizon));
  expect_uniform(lighting.environment);
  EXPECT_LT(lighting.report.seen_sr, cap_sr(100 * degree) * 0.95);
}

TEST(Estimate, ResolutionFollowsTheSourceOrTheSet) {
  EXPECT_EQ(chosen_resolution(0, 4 * pi / (512.0 * 512.0)), 512);
  EXPECT_EQ(chosen_resolution(0, 4 * pi / (512.0 * 512.0) * 0.999), 1024);
  EXPECT_EQ(chosen_resolution(0, 1e-12), 2048);
  EXPECT_EQ(chosen_resolution(64, 1e-12), 64);
  EXPECT_EQ(chosen_resolution(4096, 1), 4096);
  for (int refused : {-1, 100, 8192}) EXPECT_THROW(chosen_resolution(refused, 1), Error);
}

TEST(Estimate, RefusesFramesThatDoNotFit) {
  const LightCameraCalibration camera = fisheye_camera();
  const FramePtr frame = make_frame(2, 2, 1, std::vector<glm::dvec3>(4));
  const std::string refusal = test::error_of([&] { estimate({&frame, 1}, camera, {}); });
  EXPECT_EQ(refusal, "light frame 0 has 2x2 pixels, the light camera's calibration 512x512");
  EXPECT_THROW(estimate({}, camera, {}), Error);  // no frame
}

}  // namespace previz::lighting::estimate_test
