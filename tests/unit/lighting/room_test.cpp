// A lamp in a room, seen from the light camera, put where it stands as seen from the set.
#include "daemon/core/lighting/room.hpp"

#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/lighting/lighting.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::room_test {

using std::numbers::pi;
using test::degree;

const glm::dvec3 box_size_m(6, 5, 3);

// Standing on the floor's level, turned about Z.
glm::dmat4 box_pose() {
  return glm::rotate(glm::translate(glm::dmat4(1), glm::dvec3(0.5, 0.2, 1.4)), 0.3,
                     glm::dvec3(0, 0, 1));
}

std::shared_ptr<const Room> box_room(const glm::dvec3& seen_from) {
  return std::make_shared<const Room>(box_triangles(box_size_m, box_pose()), seen_from);
}

// Distance to the box's wall from inside, in closed form (Kay and Kajiya's slabs).
double distance_in_box(const glm::dvec3& origin, const glm::dvec3& direction) {
  const glm::dmat4 box_from_world = glm::inverse(box_pose());
  const glm::dvec3 o(box_from_world * glm::dvec4(origin, 1));
  const glm::dvec3 d(box_from_world * glm::dvec4(direction, 0));
  double nearest = 1e300;
  for (int axis = 0; axis < 3; ++axis)
    if (d[axis] != 0)
      nearest =
          std::min(nearest, (std::copysign(box_size_m[axis] / 2, d[axis]) - o[axis]) / d[axis]);
  return nearest;
}

TEST(Room, ABoxIsClosedAndAsFarAsItsWalls) {
  const glm::dvec3 origin(0.1, -0.4, 0.3);
  const auto room = box_room({2, 1, 1});
  constexpr int size = 64;
  for (int t = 0; t < size * size; ++t) {
    const glm::dvec3 direction(texel_direction(size, t % size, t / size));
    const auto distance = room->distance(origin, direction);
    ASSERT_TRUE(distance);
    EXPECT_NEAR(*distance / distance_in_box(origin, direction), 1, 1e-5);  // floats inside
    EXPECT_TRUE(room->sees(glm::dvec3(1.5, 0.5, 2), origin + *distance * direction));
  }
}

TEST(Room, WhatStandsBetweenHides) {
  Triangles walls = box_triangles(glm::dvec3(10), glm::dmat4(1));
  for (const glm::dvec3& corner : box_triangles(glm::dvec3(1), glm::dmat4(1)))
    walls.push_back(corner + glm::dvec3(2, 0, 0));
  const Room room(walls, glm::dvec3(0));
  EXPECT_NEAR(*room.distance(glm::dvec3(0), glm::dvec3(1, 0, 0)), 1.5, 1e-5);
  EXPECT_FALSE(room.sees(glm::dvec3(0), glm::dvec3(5, 0, 0)));
  EXPECT_TRUE(room.sees(glm::dvec3(2, 4, 0), glm::dvec3(5, 0, 0)));
  EXPECT_THROW(Room({}, glm::dvec3(0)), Error);
}

// A wall that a camera is mounted on, and the floor that it stands on, hide nothing (Embree meets
// the triangle that a ray starts on).
TEST(Room, ACameraOnASurfaceSeesTheRest) {
  const Room room(box_triangles(glm::dvec3(4), glm::dmat4(1)), glm::dvec3(0));
  for (const glm::dvec3& camera : {glm::dvec3(0.3, 0.2, -2), {-2, 0.1, 0.4}, {-2, 2, -2}}) {
    EXPECT_TRUE(room.sees(camera, glm::dvec3(2, 0.5, 0.25)));
    EXPECT_TRUE(room.sees(camera, glm::dvec3(0.1, 0.5, 2)));
    EXPECT_TRUE(room.sees(camera, camera));
  }
  EXPECT_FALSE(room.sees(glm::dvec3(0, 0, -2.01), glm::dvec3(0.1, 0.5, 2)));
}

TEST(Room, APlaceOnASurfaceIsBroughtBeforeIt) {
  const Triangles box = box_triangles(glm::dvec3(4), glm::dmat4(1));
  const glm::dvec3 inside(0.5, -0.5, 1);
  const auto off = [&](const glm::dvec3& place) { return off_surfaces(box, place, inside); };
  EXPECT_EQ(off(inside), inside);
  EXPECT_NEAR(off({0.3, 0.2, -2}).z, -2 + on_surface_m, 1e-12);
  EXPECT_NEAR(off({0.3, 0.2, -2 - 0.5 * on_surface_m}).z, -2 + on_surface_m, 1e-12);
  const glm::dvec3 corner = off({2, -2, -2});
  for (glm::length_t k = 0; k < 3; ++k) EXPECT_NEAR(std::abs(corner[k]), 2 - on_surface_m, 1e-12);
  // With the camera on the same floor, upwards.
  EXPECT_NEAR(off_surfaces(box, {0, 0, -2}, {1, 1, -2}).z, -2 + on_surface_m, 1e-12);
}

struct SeenLamp {
  double flux = 0;
  glm::dvec3 direction{0};
};

SeenLamp lamp_in(const EnvironmentMap& map, double ambient) {
  SeenLamp seen;
  for_each_texel(map, [&](const glm::dvec3& direction, const glm::dvec3& radiance) {
    const double above = radiance.g - ambient;
    if (above < 1) return;
    seen.flux += above * texel_sr(map.size);
    seen.direction += above * direction;
  });
  seen.direction = glm::normalize(seen.direction);
  return seen;
}

// From the camera the lamp is off by tens of degrees; from the set it is where it is, and as large
// as it looks from there: near and far lamps, seen larger and smaller than by the camera.
TEST(Parallax, ALampIsWhereTheSetSeesIt) {
  constexpr double ambient = 0.2, radiance = 300;
  const glm::dvec3 seen_from(0.0, 0.0, 0.3), camera_place(1.6, -0.9, 0.2);
  LightCameraCalibration camera = test::fisheye_camera(256, test::looking(10, 90));
  camera.world_from_camera[3] = glm::dvec4(camera_place, 1);
  for (const glm::dvec3& direction :
       {test::towards(-30, 50), test::towards(160, 40), test::towards(60, 75)}) {
    // A disc on the wall where a ray from `seen_from` meets it, painted by distance along the wall.
    const glm::dvec3 lamp = seen_from + distance_in_box(seen_from, direction) * direction;
    const auto sky_from = [&](const glm::dvec3& from) {
      return [&lamp, from](const glm::dvec3& d) {
        const glm::dvec3 hit = from + distance_in_box(from, d) * d;
        return glm::dvec3(glm::distance(hit, lamp) < 0.25 ? radiance : ambient);
      };
    };
    std::vector<FramePtr> frames;
    for (const double exposure : {1.0 / 512, 1.0})
      frames.push_back(
          test::photograph(camera, sky_from(camera_place), exposure, test::Detail::fine));
    const set::Lighting settings = test::unseen_as(set::UnseenRule::constant, ambient);
    const SeenLamp far = lamp_in(estimate(frames, camera, settings).environment, ambient);
    const SeenLamp near =
        lamp_in(estimate(frames, camera, settings, box_room(seen_from)).environment, ambient);

    // What a fine grid of rays from the set sees of it.
    EnvironmentMap truth{1024, {}};
    const auto sky = sky_from(seen_from);
    for (int t = 0; t < 1024 * 1024; ++t)
      truth.radiance.emplace_back(
          sky(glm::normalize(glm::dvec3(texel_direction(1024, t % 1024, t / 1024)))));
    const SeenLamp expected = lamp_in(truth, ambient);
    EXPECT_GT(std::acos(glm::dot(far.direction, expected.direction)), 10 * degree);
    // A pixel is 0.75 degrees, and a lamp's centre is known to a small part of one.
    EXPECT_LT(std::acos(std::min(1.0, glm::dot(near.direction, expected.direction))),
              0.15 * degree);
    EXPECT_NEAR(near.flux / expected.flux, 1, 0.02);
  }
}

// The place is the middle of tag 0 by default, which lies on the table. One centimetre above it,
// walls 2.3 m away and more are seen within 0.25 degrees of where they were: the ring in which the
// light changes by 2, at 60 degrees from the zenith, moves by at most 0.024 sr, less than 0.01 of
// the flux of 4 pi sr with at least half of them lit by 1.
TEST(Parallax, APlaceOnTheFloorKeepsTheMeasuredLight) {
  LightCameraCalibration camera = test::fisheye_camera(128, test::looking(0, 90));
  camera.world_from_camera[3] = glm::dvec4(0.5, 0.2, 1, 1);
  const FramePtr frame = test::photograph(
      camera, [](const glm::dvec3& d) { return glm::dvec3(d.z > 0.5 ? 3 : 1); }, 0.25);
  const Triangles walls = box_triangles(box_size_m, box_pose());  // its floor is at -0.1 m
  const auto flux_from = [&](double height_m) {
    const glm::dvec3 place =
        off_surfaces(walls, {0.5, 0.2, -0.1 + height_m}, camera.world_from_camera[3]);
    return total_flux(estimate({&frame, 1}, camera, test::unseen_as(set::UnseenRule::constant, 0),
                               std::make_shared<const Room>(walls, place))
                          .environment)
        .g;
  };
  EXPECT_NEAR(flux_from(0) / flux_from(1e-2), 1, 0.01);
  EXPECT_NEAR(flux_from(-1e-4) / flux_from(1e-2), 1, 0.01);
}

TEST(Parallax, AUniformRoomIsUniform) {
  const LightCameraCalibration camera = test::fisheye_camera(128, test::looking(0, 90));
  const FramePtr frame = test::photograph(
      camera, [](const glm::dvec3&) { return glm::dvec3(1, 2, 3); }, 0.25);
  for (const auto rule : {set::UnseenRule::horizon, set::UnseenRule::mirror}) {
    const Lighting lighting =
        estimate({&frame, 1}, camera, test::unseen_as(rule), box_room(glm::dvec3(1, 1, 0.5)));
    for (const glm::vec3& radiance : lighting.environment.radiance)
      ASSERT_LT(glm::length(radiance - glm::vec3(1, 2, 3)), 2e-4f);
  }
}

}  // namespace previz::lighting::room_test
