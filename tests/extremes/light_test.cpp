// Lamps of no size, lamps all around, lamps in an object or on it, and lamps drowned by others.
#include "tests/extremes/every_way.hpp"

namespace previz::test::light_test {

constexpr set::LightType near_types[] = {set::LightType::point, set::LightType::spot,
                                         set::LightType::rectangle, set::LightType::sphere};

constexpr double pi = std::numbers::pi;
constexpr double albedo = 0.5;

render::Layers show(const View& view, int samples = 32) {
  return render_clean(view, samples, up_to_depth(4)).layers;
}

class LightByEveryWay : public EveryWay {
 protected:
  // Over a black plate. Lamps that the difference estimator is to find are virtual, because it
  // leaves out the light that both worlds share.
  static render::Layers show(View view, int samples = 32) {
    if (GetParam().estimator == set::Estimator::difference)
      for (set::Light& light : view.scene.lights) light.gain_real = 0;
    const PinholeIntrinsics& k = view.calibration.intrinsics;
    const Seen nothing{{k.width, k.height, 16,
                        std::vector<std::uint16_t>(3 * static_cast<std::size_t>(k.width) *
                                                   static_cast<std::size_t>(k.height))},
                       1};
    return render_by(GetParam(), view, nothing, samples, up_to_depth(4)).layers;
  }
  void expect_irradiance(const View& view, double irradiance) const;
};
// A single surface passes no light on, so there is nothing that the camera could know of it.
INSTANTIATE_TEST_SUITE_P(Ways, LightByEveryWay, testing::Values(paired, difference), name_of_way);

// Four standard errors, and `bias`: what the picture's 1 mm and single precision may move.
void expect_irradiance(const render::Layers& layers, double irradiance, double bias = 1e-3) {
  const double expected = albedo / pi * irradiance;
  EXPECT_NEAR(mean(layers.mixed).g, expected,
              4 * standard_error_of_pixels(layers) + bias * expected);
  EXPECT_LT(standard_error_of_pixels(layers), 0.01 * expected) << "nothing was shown";
}

void LightByEveryWay::expect_irradiance(const View& view, double irradiance) const {
  light_test::expect_irradiance(show(view), irradiance);
}

// From a disc as wide as the hemisphere down to nothing, at the same irradiance.
TEST_P(LightByEveryWay, ADiscBringsItsIrradianceAtAnyAngle) {
  for (const double radius : {pi / 2, 0.1, 1e-3, 1e-5, 1e-9, 1e-20, 0.0}) {
    SCOPED_TRACE(radius);
    View view = lit_point(albedo);
    view.scene.lights = {sun_lamp({0, 0, -1}, radius)};
    expect_irradiance(view, 1);
  }
}

// What a camera sees of a disc, integrated over the picture, is the irradiance the disc brings: its
// edge is where it should be, however small it is. A camera ray is right to 1e-7.
TEST(ExtremeLight, ADiscLooksAsLargeAsItIs) {
  for (const double radius : {0.2, 4.65e-3, 1e-3, 1e-4}) {
    View view = empty_view({0, 0, 0}, {0, 0, 1}, pinhole(64, 64, 4 * radius));
    view.scene.lights = {sun_lamp({0, 0, -1}, radius)};
    const render::Layers layers = show(view, 64);
    const PinholeIntrinsics& k = view.calibration.intrinsics;
    double flux = 0;
    for (const auto& [x, y, i] : pixels_of(k.width, k.height)) {
      const double u = (x - k.cx) / k.fx, v = (y - k.cy) / k.fy;
      // dw cos(theta) of a pixel: 1 / (fx fy) (1 + u^2 + v^2)^-2
      flux +=
          static_cast<double>(layers.mixed[i].g) / (k.fx * k.fy * std::pow(1 + u * u + v * v, 2));
    }
    // Pixels that the edge crosses, 100 with 64 stratified samples each, are uncertain by 0.5 / 64
    // of a pixel at most; the disc covers 800.
    EXPECT_NEAR(flux, 1, 4 * std::sqrt(100.0) / 128 / 800 + 4e-7 / radius) << radius;
  }
}

TEST_P(LightByEveryWay, ASphereOfAlmostNoSize) {
  for (const double radius : {0.1, 1e-4, 1e-9, 1e-15}) {
    SCOPED_TRACE(radius);
    View view = lit_point(albedo);
    view.scene.lights.push_back(
        sphere_lamp({0.5, 0, 1}, radius, glm::dvec3(1 / (radius * radius))));
    expect_irradiance(view, pi / 1.25 * (1 / std::sqrt(1.25)));
  }
}

TEST_P(LightByEveryWay, ARectangleOfAlmostNoSize) {
  for (const double side : {1e-2, 1e-6, 1e-12}) {
    SCOPED_TRACE(side);
    View view = lit_point(albedo);
    view.scene.lights.push_back(panel_lamp({0, 0, 1}, {side, side}, glm::dvec3(1 / (side * side))));
    expect_irradiance(view, 1);
  }
}

// An area that single precision rounds to nothing is no light, and not one that fills the view.
TEST_P(LightByEveryWay, ARectangleOfNoSizeIsNotSeen) {
  View view = lit_point(albedo);
  set::Light panel = lamp(set::LightType::rectangle);
  panel.position = {0, -0.1, 0.05};  // between the camera and what it looks at
  panel.direction = {0, -1, 0.5};
  panel.width_m = panel.height_m = 1e-25;
  panel.emission = glm::dvec3(1e6);
  view.scene.lights.push_back(panel);
  EXPECT_EQ(mean(show(view).mixed), glm::dvec3(0));
}

// A closed lamp all around: every direction brings the same radiance.
TEST(ExtremeLight, ALampThatFillsTheSphere) {
  View view = lit_point(albedo, 1);
  add(view.scene, inside_out(icosphere_mesh(5, 3)), emitter(glm::vec3(2)));
  expect_irradiance(show(view), 2 * pi);
}

// Sphere lamps emit outwards: inside one there is no light, and no division by a negative angle.
TEST(ExtremeLight, InsideASphereLampItIsDark) {
  View view = lit_point(albedo, 1);
  view.scene.lights = {sphere_lamp({0, 0, 0}, 5)};
  EXPECT_EQ(mean(show(view).mixed), glm::dvec3(0));
}

// Every kind of lamp in a closed opaque box: nothing comes out. In a glass ball: finite.
TEST(ExtremeLight, InsideAnObject) {
  for (const auto type : near_types) {
    for (const bool opaque : {true, false}) {
      View view = lit_point(albedo);
      const auto material = add_material(view.scene, opaque ? diffuse(glm::vec3(1)) : glass(1.5f));
      add(view.scene, opaque ? box_mesh({0.3, 0.3, 0.3}) : icosphere_mesh(0.2, 3), material,
          at({0.2, 0, 0.6}), scene::world_mixed);
      set::Light inside = lamp(type);
      inside.position = {0.2, 0, 0.6};
      inside.width_m = inside.height_m = inside.radius_m = 0.05;
      view.scene.lights.push_back(inside);
      const render::Layers layers = show(view, 8);
      EXPECT_GT(mean(layers.real).g, 0);  // where the object is not, the lamp shines
      if (opaque) {
        EXPECT_EQ(mean(layers.mixed), glm::dvec3(0));
      }
    }
  }
}

// Exactly on the surface it would light, and exactly where the camera is: no sample is dropped
// (show() sees to that), and no pixel is infinite, negative or not a number.
TEST_P(LightByEveryWay, OnASurfaceAndInTheLens) {
  for (const auto type : near_types) {
    for (const glm::dvec3& place : {glm::dvec3(0), glm::dvec3(0, -1, 0.5)}) {
      View view = lit_point(albedo);
      set::Light light = lamp(type);
      light.position = place;
      light.width_m = light.height_m = light.radius_m = 0.01;
      view.scene.lights.push_back(light);
      const render::Layers layers = show(view, 8);
      for (const auto* layer : {&layers.mixed, &layers.real})
        for (const glm::vec3& radiance : *layer)
          for (int c = 0; c < 3; ++c)
            ASSERT_TRUE(std::isfinite(radiance[c]) && radiance[c] >= 0) << radiance[c];
    }
  }
}

// A faint lamp close by, in a stage whose sun has 1e11 times its power: half of the light here is
// the lamp's, and it must not be forgotten when lights are chosen.
TEST_P(LightByEveryWay, ACandleIsNotDrownedByASun) {
  View view = lit_point(albedo);
  for (const double x : {-1e3, 1e3}) add_instance(view.scene, 0, 0, at({x, 0, 0}));
  view.scene.lights = {lamp(set::LightType::directional),
                       point_lamp({0, 0, 0.01}, glm::dvec3(1e-4))};
  view.calibration = pinhole(24, 24, 1e-4);
  expect_irradiance(view, 2);
}

TEST_P(LightByEveryWay, BlackLampsLightNothing) {
  View view = lit_point(albedo);
  for (const auto type : {set::LightType::point, set::LightType::directional,
                          set::LightType::rectangle, set::LightType::sphere}) {
    set::Light light = lamp(type);
    light.position = {0, 0, 1};
    light.radius_m = 0.1;
    light.emission = glm::dvec3(0);
    view.scene.lights.push_back(light);
  }
  EXPECT_EQ(mean(show(view, 4).mixed), glm::dvec3(0));
}

}  // namespace previz::test::light_test
