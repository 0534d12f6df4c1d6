// A virtual object that rests exactly on the real table, reaches into it, or contains the camera.
#include <glm/gtc/matrix_transform.hpp>

#include "tests/extremes/every_way.hpp"

namespace previz::test::contact_test {

constexpr int width = 64, height = 48;
constexpr double albedo = 0.5;
// What the sun brings to the table.
const double lit = albedo / std::numbers::pi * 0.5 / std::sqrt(1.25);

// A real table z = 0 under a point lamp and no other light, seen from the shadows' side.
View table() {
  View view = empty_view({0.1, -1.2, 0.9}, {0, -0.1, 0}, pinhole(width, height, 0.6));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(albedo)));
  view.scene.lights = {sun_lamp(glm::normalize(glm::dvec3(0, -1, -0.5)))};
  return view;
}

std::uint32_t add_virtual(View& view, const scene::Mesh& mesh, const glm::dvec3& place) {
  return add(view.scene, mesh, diffuse({0.8f, 0.3f, 0.2f}), at(place), scene::world_mixed);
}

Rendered show(const View& view, set::Estimator estimator = set::Estimator::paired) {
  return render_clean(view, 4, up_to_depth(1, estimator));
}

class ContactByEveryWay : public EveryWay {
 protected:
  // Over what the sun makes of the table.
  static Rendered show(const View& view) {
    static const Seen lit_table = seen_by_camera(table(), 1, 4, up_to_depth(1));
    return render_by(GetParam(), view, lit_table, 4, up_to_depth(1));
  }
};
INSTANTIATE_TEST_SUITE_P(Ways, ContactByEveryWay, testing::Values(paired, difference, by_camera),
                         name_of_way);

// Pixels whose whole area shows the table inside of a rectangle, by their corners.
template <typename Visit>
void for_table_pixels(const View& view, const glm::dvec2& low, const glm::dvec2& high,
                      const Visit& visit) {
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  const glm::dvec3 eye(view.world_from_camera[3]);
  int visited = 0;
  for (const auto& [x, y, i] : pixels_of(width, height)) {
    bool inside = true;
    for (const glm::dvec2& corner : {glm::dvec2(-0.5, -0.5), glm::dvec2(0.5, -0.5),
                                     glm::dvec2(-0.5, 0.5), glm::dvec2(0.5, 0.5)}) {
      const glm::dvec2 straight((x + corner.x - k.cx) / k.fx, (y + corner.y - k.cy) / k.fy);
      const glm::dvec3 ray(view.world_from_camera * glm::dvec4(straight, 1, 0));
      const glm::dvec3 met = eye - ray * (eye.z / ray.z);
      inside = inside && met.x > low.x && met.x < high.x && met.y > low.y && met.y < high.y;
    }
    if (!inside) continue;
    ++visited;
    visit(i);
  }
  EXPECT_GT(visited, 20) << "nothing was looked at";
}

// The decal lies in the table's plane. Whichever comes first in the scene is seen, everywhere.
TEST(Contact, OfTwoFacesInOnePlaneOneWinsEverywhere) {
  for (const bool table_first : {true, false}) {
    for (const double turn : {0.0, 0.4}) {
      View view = table();
      add_virtual(view, rectangle_mesh({0.6, 0.6}), {0, 0, 0});
      const glm::dmat4 turned =
          glm::rotate(glm::dmat4(1), turn, glm::normalize(glm::dvec3(1, 2, 3)));
      if (!table_first) std::swap(view.scene.instances[0], view.scene.instances[1]);
      for (scene::Instance& instance : view.scene.instances)
        instance.world_from_object = turned * instance.world_from_object;
      view.scene.lights[0].direction = glm::dmat3(turned) * view.scene.lights[0].direction;
      const View untilted = view;
      view.world_from_camera = turned * view.world_from_camera;
      const Rendered result = show(view);
      for_table_pixels(untilted, glm::dvec2(-0.3), glm::dvec2(0.3), [&](std::size_t i) {
        ASSERT_EQ(result.layers.mask[i], table_first ? 0.0f : 1.0f) << i;
        // Neither shadows the other.
        ASSERT_NEAR(result.layers.mixed[i].g, table_first ? lit : lit * 0.3 / albedo, 1e-5) << i;
      });
    }
  }
}

// The sun comes from behind the box: all of the table before it, up to its very foot, loses all of
// its light, to the rounding of a float, but for a share of the samples. Rays that start `lift_m`
// above the table miss the tip of the shadow by twice that.
void expect_dark_before_box(const View& view, double top_m, double lift_m = 0, double stray = 0) {
  for (const auto estimator : both_estimators) {
    const Rendered result = show(view, estimator);
    // The shadow is twice as long as the box is high.
    const double tip = -0.2 - 2 * (top_m - lift_m);
    double pixels = 0, left = 0;
    for_table_pixels(view, {-0.2, tip}, {0.2, -0.2}, [&](std::size_t i) {
      ASSERT_EQ(result.layers.mask[i], 0.0f) << i;
      if (stray == 0) {
        ASSERT_NEAR(result.layers.diff[i].g, -lit, 1e-6) << i;
      }
      ++pixels;
      left += 1 + result.layers.diff[i].g / lit;
    });
    EXPECT_LE(left, stray * pixels + 1e-6 / lit * pixels);
  }
}

TEST(Contact, ARestingBoxCastsItsShadowWithoutAGap) {
  for (const double top : {0.4, 0.05}) {
    View view = table();
    add_virtual(view, box_mesh({0.4, 0.4, top}), {0, 0, top / 2});
    expect_dark_before_box(view, top);
  }
}

// A road of 1 km x 4 m is two slivers. The bound on their rounding must not lift rays over the box.
TEST(Contact, ABoxOnALongRoadCastsItsShadowWithoutAGap) {
  for (const glm::dvec2& size : {glm::dvec2(1000, 4), glm::dvec2(4, 1000)}) {
    for (const double top : {0.05, 0.01}) {
      SCOPED_TRACE(std::to_string(size.x) + " m x " + std::to_string(size.y) + " m, box of " +
                   std::to_string(top) + " m");
      View view = table();
      view.scene.meshes[0] = rectangle_mesh(size);
      add_virtual(view, box_mesh({0.4, 0.4, top}), {0, 0, top / 2});
      // The shadow of the low box is 2 cm wide, less than a pixel of the others' picture.
      view.world_from_camera = look_at({0.01, -0.2 - 8 * top, 6 * top}, {0, -0.2 - top, 0});
      // The bound is 8 half ulps of a kilometre, four times for a sliver: 1.9 mm. Along the road a
      // sliver's weights say where a ray met it to 8 half ulps times its aspect of 250, which is 12
      // cm of a kilometre at worst and rarely more than the shadow is long.
      expect_dark_before_box(view, top, 2e-3, 0.01);
    }
  }
}

// The road by itself, turned any way, is lit everywhere: no ray meets what it leaves. Beside an
// edge of two slivers rounding may still see the other one: within a few ulps of the kilometre,
// 6e-5 m, of which each pixel of the picture is a hundredth or more; here that is a few samples of
// 12288.
TEST(Contact, ALongRoadDoesNotShadowItself) {
  for (const double turn : {0.0, 0.4, 1.1}) {
    View view = table();
    view.scene.meshes[0] = rectangle_mesh({1000, 4});
    const glm::dmat4 turned = glm::rotate(glm::dmat4(1), turn, glm::normalize(glm::dvec3(1, 2, 3)));
    view.scene.instances[0].world_from_object = turned;
    view.scene.lights[0].direction = glm::dmat3(turned) * view.scene.lights[0].direction;
    view.world_from_camera = turned * view.world_from_camera;
    const Rendered result = show(view);
    const auto is_dark = [](const glm::vec3& pixel) { return std::abs(pixel.g - lit) > 1e-5; };
    EXPECT_LE(std::ranges::count_if(result.layers.mixed, is_dark), 4) << turn;
  }
}

TEST(Contact, AnInterpenetratingBoxCastsItsShadowWithoutAGap) {
  View view = table();
  add_virtual(view, box_mesh({0.4, 0.4, 0.4}), {0, 0, 0.1});
  expect_dark_before_box(view, 0.3);
}

// Two virtual boxes with all their faces in common, and one that reaches through both: the picture
// is that of the first.
TEST_P(ContactByEveryWay, TwinsLookLikeOne) {
  View one = table();
  add_virtual(one, box_mesh({0.4, 0.4, 0.4}), {0, 0, 0.2});
  View twins = one;
  const scene::Instance first = twins.scene.instances.back();
  add_instance(twins.scene, first.mesh, add_material(twins.scene, diffuse({0.1f, 0.9f, 0.4f})),
               first.world_from_object, first.presence);
  EXPECT_EQ(show(one).layers.mixed, show(twins).layers.mixed);
}

// The same again and again: nothing depends on the order in which invocations run.
TEST_P(ContactByEveryWay, IsDeterministic) {
  View view = table();
  add_virtual(view, box_mesh({0.4, 0.4, 0.4}), {0, 0, 0.1});
  add_virtual(view, uv_sphere_mesh(0.2, 24, 12), {0.15, -0.1, 0.1});
  add_virtual(view, rectangle_mesh({1, 1}), {0, 0, 0});
  const render::Layers first = show(view).layers;
  for (int i = 0; i < 2; ++i) {
    const render::Layers again = show(view).layers;
    EXPECT_EQ(again.mixed, first.mixed);
    EXPECT_EQ(again.mask, first.mask);
  }
}

// In a closed virtual box that emits 1 and reflects a half, every pixel is covered and shows 2; in
// the real world the camera sees past it.
TEST(Contact, ABoxAroundTheCameraCoversEverything) {
  for (const auto estimator : both_estimators) {
    View view = table();
    scene::Material wall = diffuse(glm::vec3(0.5f));
    wall.emission = glm::vec3(1);
    add(view.scene, inside_out(box_mesh({1, 1, 1})), wall, at({0.1, -1.2, 0.9}),
        scene::world_mixed);
    const Rendered result = render_view(view, 8, up_to_depth(64, estimator));
    for (const float mask : result.layers.mask) ASSERT_EQ(mask, 1.0f);
    EXPECT_NEAR(mean(result.layers.mixed).g, 2, 4 * standard_error_of_pixels(result.layers) + 1e-5);
    EXPECT_GT(mean(result.layers.real).g, 0);
    expect_clean(result.counters);
  }
}

// Inside a ball of clear glass in a white environment all directions bring 1.
TEST(Contact, AGlassBallAroundTheCameraTakesNothing) {
  View view = empty_view({0.3, -0.2, 0.1}, {0, 1, 0.2}, pinhole(width, height, 1.5), glm::vec3(1));
  add(view.scene, icosphere_mesh(1, 4), glass(1.5f), glm::dmat4(1), scene::world_mixed);
  const Rendered result = render_clean(view, 4, up_to_depth(64));
  // Inside, a ray meets the ball at the same angle again and again; from 0.37 off the centre of one
  // of index 1.5 that angle is below the critical one, so every ray comes out.
  for (const glm::vec3& pixel : result.layers.mixed) EXPECT_NEAR(pixel.g, 1, 1e-5f);
  for (const float mask : result.layers.mask) ASSERT_EQ(mask, 1.0f);
}

}  // namespace previz::test::contact_test
