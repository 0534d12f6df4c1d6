// The same set at another size, and at another place, shows the same picture.
#include <glm/gtc/matrix_transform.hpp>

#include "tests/extremes/every_way.hpp"

namespace previz::test::scale_test {

// Every material, a lens, lamps with and without an extent, and glass that casts a caustic.
View rich_set() {
  View view = random_scene(4, {.width = 48, .height = 36, .lens = true});
  add(view.scene, icosphere_mesh(0.05, 3), glass(1.5f), at({0.02, -0.12, 0.08}),
      scene::world_mixed);
  view.scene.lights = {point_lamp({0.3, 0.2, 0.9}, glm::dvec3(0.4, 0.5, 0.6)),
                       panel_lamp({-0.3, 0.1, 0.8}, {0.1, 0.1}, glm::dvec3(2))};
  return view;
}

// Everything `factor` times as large and then moved. A point's intensity grows with the square of
// the distances, so that the radiance stays as it is.
View resized(View view, double factor, const glm::dvec3& move = {}) {
  const glm::dmat4 place = glm::scale(at(move), glm::dvec3(factor));
  for (scene::Instance& instance : view.scene.instances)
    instance.world_from_object = place * instance.world_from_object;
  for (set::Light& light : view.scene.lights) {
    light.position = factor * light.position + move;
    light.width_m *= factor;
    light.height_m *= factor;
    if (light.type == set::LightType::point) light.emission *= factor * factor;
  }
  view.world_from_camera[3] = glm::dvec4(factor * glm::dvec3(view.world_from_camera[3]) + move, 1);
  if (view.calibration.lens) {
    view.calibration.lens->focal_length_m *= factor;
    view.calibration.lens->focus_distance_m *= factor;
  }
  return view;
}

constexpr int samples = 8;

Rendered show(const View& view) {
  return render_clean(view, samples, up_to_depth(6));
}

// The camera's picture of the set at its own size, which is the same at every size and place.
const Seen& seen() {
  static const Seen plate = seen_by_camera(rich_set(), 0.25, samples, up_to_depth(6));
  return plate;
}

class ScaleByEveryWay : public EveryWay {
 protected:
  static Rendered show(const View& view, Plate* shown = nullptr) {
    return render_by(GetParam(), view, seen(), samples, up_to_depth(6), shown);
  }
};
INSTANTIATE_TEST_SUITE_P(Ways, ScaleByEveryWay, testing::Values(paired, difference, by_camera),
                         name_of_way);

// Rounding takes a path another way only where it passes an edge, of an object, a lobe or a
// shadow, by less than about 1e-6 of the set's size. A sample makes up to 6 * 3 such choices where
// a pixel is 1/48 of the set: 8 * 18 * 48e-6, less than 1 in 100 pixels, and then a sample of 8. Of
// the rest nothing is left but rounding: 1e-6 in the hit's place, 1e3 times that at the smooth
// metals' curved reflections, in both directions by chance: a tenth of it in the mean.
void expect_same(const render::Layers& a, const render::Layers& b) {
  const auto apart = static_cast<std::size_t>(
      std::inner_product(a.mixed.begin(), a.mixed.end(), b.mixed.begin(), 0, std::plus<>(),
                         [](const glm::vec3& x, const glm::vec3& y) {
                           return std::abs(x.g - y.g) > 1e-3f * std::max(x.g, y.g) ? 1 : 0;
                         }));
  EXPECT_LE(apart, a.mixed.size() / 100);
  EXPECT_NEAR(mean(a.mixed).g / mean(b.mixed).g, 1, 0.01 / 8 + 1e-4);
  for (std::size_t i = 0; i < a.mask.size(); ++i) ASSERT_NEAR(a.mask[i], b.mask[i], 0.251f) << i;
}

// Nothing in the renderer may know how large a metre is: times a power of two, every product and
// every sum rounds as it did, and no bit changes.
TEST_P(ScaleByEveryWay, APowerOfTwoChangesNoBit) {
  const View view = rich_set();
  Plate plain_picture, picture;
  const render::Layers plain = show(view, &plain_picture).layers;
  for (const double factor : {1.0 / 1024, 1024.0}) {
    const render::Layers other = show(resized(view, factor), &picture).layers;
    EXPECT_EQ(picture.samples, plain_picture.samples) << factor;
    EXPECT_EQ(other.mixed, plain.mixed) << factor;
    EXPECT_EQ(other.diff, plain.diff) << factor;
    EXPECT_EQ(other.mask, plain.mask) << factor;
    for (std::size_t i = 0; i < plain.depth.size(); ++i)
      ASSERT_EQ(other.depth[i], static_cast<float>(factor) * plain.depth[i]) << factor;
  }
}

TEST_P(ScaleByEveryWay, AThousandAndAThousandthShowTheSame) {
  const View view = rich_set();
  const render::Layers plain = show(view).layers;
  for (const double factor : {1e-3, 1e3}) {
    SCOPED_TRACE(factor);
    expect_same(show(resized(view, factor)).layers, plain);
  }
}

// GPU space is relative to the camera, subtracted in double precision: 1 km away, what is left of
// a position is right to 1e-13 m.
TEST_P(ScaleByEveryWay, AKilometreFromTheOriginShowsTheSame) {
  const View view = rich_set();
  expect_same(show(resized(view, 1, {700, -600, 400})).layers, show(view).layers);
}

// Inside a closed black-lit box with bright light all around it: what is not black has leaked.
TEST(Scale, NothingLeaksIntoAClosedBoxOfAnySize) {
  View view = empty_view({0.1, -0.2, 0.1}, {0.9, 0.8, 0.6}, pinhole(48, 48, 1.8), glm::vec3(1e6f));
  view.scene = furnace_box({2, 1.7, 1.3}, diffuse(glm::vec3(0.9f)));
  for (const double factor : {1e-3, 1.0, 1e3}) {
    for (const glm::dvec3& move : {glm::dvec3(0), glm::dvec3(700, -600, 400)}) {
      const Rendered result = show(resized(view, factor, move));
      for (const glm::vec3& pixel : result.layers.mixed) ASSERT_EQ(pixel, glm::vec3(0)) << factor;
    }
  }
}

// A sun two degrees above the horizon: where a surface shadows itself, a pixel is dark.
TEST(Scale, NoSurfaceOfAnySizeShadowsItself) {
  const glm::dmat4 turned = glm::rotate(glm::dmat4(1), 0.3, glm::normalize(glm::dvec3(1, 2, 3)));
  const glm::dmat3 turn(turned);
  View view = empty_view(turn * glm::dvec3(0.3, -1, 2), {0, 0, 0}, pinhole(48, 48, 0.9));
  add(view.scene, rectangle_mesh({40, 40}), diffuse(glm::vec3(0.5f)), turned);
  view.scene.lights = {sun_lamp(turn * glm::dvec3(-std::cos(0.035), 0, -std::sin(0.035)))};
  const double expected = 0.5 / std::numbers::pi * std::sin(0.035);
  for (const double factor : {1e-3, 1.0, 1e3}) {
    for (const glm::dvec3& move : {glm::dvec3(0), glm::dvec3(700, -600, 400)}) {
      const Rendered result = show(resized(view, factor, move));
      // One float rounding of the normal is 1e-7 / 0.035 of the cosine.
      for (const glm::vec3& pixel : result.layers.mixed)
        ASSERT_NEAR(pixel.g / expected, 1, 2e-5) << factor;
    }
  }
}

}  // namespace previz::test::scale_test
