// Light of any strength: the picture is linear in it, and a sun does not drown its sky.
#include "shaders/lib/octahedral.h"
#include "tests/extremes/every_way.hpp"

namespace previz::test::radiance_test {

View lit_set() {
  View view = random_scene(6, {.width = 48, .height = 36});
  view.scene.lights = {point_lamp({0.3, 0.2, 0.9}, glm::dvec3(0.4, 0.5, 0.6))};
  return view;
}

View brightened(View view, float factor) {
  for (glm::vec3& texel : view.environment.radiance) texel *= factor;
  for (scene::Material& material : view.scene.materials) material.emission *= factor;
  for (set::Light& light : view.scene.lights) light.emission *= factor;
  return view;
}

render::Layers show(const View& view) {
  return render_clean(view, 8, up_to_depth(6)).layers;
}

// The camera's exposure is as much shorter as the light is brighter, so that its picture stays.
class RadianceByEveryWay : public EveryWay {
 protected:
  static render::Layers show(const View& view, float factor, Plate* shown = nullptr) {
    static const Seen seen = seen_by_camera(lit_set(), 0.25, 8, up_to_depth(6));
    Seen exposed = seen;
    exposed.exposure /= static_cast<double>(factor);
    return render_by(GetParam(), brightened(view, factor), exposed, 8, up_to_depth(6), shown)
        .layers;
  }
};
INSTANTIATE_TEST_SUITE_P(Ways, RadianceByEveryWay, testing::Values(paired, difference, by_camera),
                         name_of_way);

TEST_P(RadianceByEveryWay, APowerOfTwoScalesEveryBit) {
  const View view = lit_set();
  Plate plain_picture, picture;
  const render::Layers plain = show(view, 1, &plain_picture);
  for (const float factor : {0x1p-20f, 0x1p20f}) {
    const render::Layers other = show(view, factor, &picture);
    EXPECT_EQ(picture.samples, plain_picture.samples) << factor;
    for (std::size_t i = 0; i < plain.mixed.size(); ++i) {
      ASSERT_EQ(other.mixed[i], factor * plain.mixed[i]) << factor;
      ASSERT_EQ(other.diff[i], factor * plain.diff[i]) << factor;
    }
  }
}

TEST_P(RadianceByEveryWay, AMillionAndAMillionthScaleThePicture) {
  const View view = lit_set();
  const render::Layers plain = show(view, 1);
  for (const float factor : {1e-6f, 1e6f}) {
    const render::Layers other = show(view, factor);
    for (std::size_t i = 0; i < plain.mixed.size(); ++i)
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(other.mixed[i][c] / factor, plain.mixed[i][c], 1e-4 * plain.mixed[i][c]);
  }
}

// An albedo that is no number, and one below nothing, which no loader lets through: every sample
// they spoil is counted, none is dropped in silence, and the picture stays finite.
TEST(Radiance, ThatCannotBeIsCounted) {
  for (const float albedo : {std::nanf(""), -0.5f}) {
    View view = empty_view({0, -0.6, 1}, {0, 0, 0}, pinhole(16, 16, 0.5));
    add(view.scene, rectangle_mesh({20, 20}), diffuse(glm::vec3(albedo)));
    view.scene.lights = {point_lamp({0.3, 0.2, 0.9})};
    const Rendered result = render_view(view, 4);
    const render::Counters& counters = result.counters;
    constexpr std::uint64_t all = 16 * 16 * 4;
    EXPECT_EQ(albedo < 0 ? counters.dropped_negative : counters.dropped_not_finite, all) << albedo;
    for (const glm::vec3& pixel : result.layers.mixed) EXPECT_EQ(pixel, glm::vec3(0));
  }
}

constexpr int sun_map = 32;
constexpr int sun_x = 19, sun_y = 13;

// Integral of cos(theta) dw over the bilinear bump of one texel of radiance 1, by midpoints: what
// that texel brings to a surface that faces up. The map has equal areas.
double bump_irradiance() {
  constexpr int steps = 200;
  double sum = 0;
  for (int j = 0; j < 2 * steps; ++j) {
    for (int i = 0; i < 2 * steps; ++i) {
      const double x = (i + 0.5) / steps - 1, y = (j + 0.5) / steps - 1;  // in texels
      const glm::vec2 at((sun_x + 0.5 + x) / sun_map * 2 - 1, (sun_y + 0.5 + y) / sun_map * 2 - 1);
      sum += (1 - std::abs(x)) * (1 - std::abs(y)) *
             std::max(0.0, static_cast<double>(octahedral_direction(at).z));
    }
  }
  return sum * 4 * std::numbers::pi / (sun_map * sun_map) / (steps * steps);
}

TEST(Radiance, OfASunAMillionTimesItsSkyIsUnbiasedAndSoIsTheSky) {
  for (const float sun : {1.0f, 1e6f}) {
    View view = empty_view({0, -0.6, 1}, {0, 0, 0}, pinhole(32, 32, 1e-3));
    add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.5f)));
    view.environment = uniform_environment(glm::vec3(1), sun_map);
    view.environment.radiance[sun_y * sun_map + sun_x] = glm::vec3(sun);
    const render::Layers layers = show(view);
    const double expected = 0.5 * (1 + (sun - 1) * bump_irradiance() / std::numbers::pi);
    // Four standard errors, and 1e-4 for the quadrature and single precision.
    EXPECT_NEAR(mean(layers.mixed).g, expected,
                4 * standard_error_of_pixels(layers) + 1e-4 * expected);
  }
}

}  // namespace previz::test::radiance_test
