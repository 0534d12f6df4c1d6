// White furnaces: where the light around is the same from everywhere, what a surface shows has a
// closed form.
#include "tests/support/ggx_albedo.hpp"
#include "tests/support/render_fixture.hpp"
#include "tests/truth/cpu_bsdf.hpp"

namespace previz::test::furnace_test {

// A large square at the origin in a uniform environment of radiance 1, seen under an angle from its
// normal by a camera whose picture is so narrow that the angle is the same in all of it.
View tilted_plane(const scene::Material& material, double angle_rad) {
  View view = empty_view({0, -std::sin(angle_rad), std::cos(angle_rad)}, {0, 0, 0},
                         pinhole(32, 32, 1e-3), glm::vec3(1));
  add(view.scene, rectangle_mesh({2, 2}), material);
  return view;
}

double mean_mixed(const render::Layers& layers) {
  return mean(layers.mixed).g;
}

// Four standard errors (one test in 16,000 fails by chance) and single precision.
double tolerance(const render::Layers& layers) {
  return 4 * standard_error_of_pixels(layers) + 1e-6;
}

TEST(Furnace, AnEmptySceneShowsTheEnvironmentExactly) {
  View view;
  view.environment = uniform_environment(glm::vec3(0.25f, 0.5f, 2.0f));
  view.calibration = pinhole(33, 17, 0.9);
  const Rendered result = render_clean(view, 3);
  for (const glm::vec3& pixel : result.layers.mixed) EXPECT_EQ(pixel, glm::vec3(0.25f, 0.5f, 2.0f));
}

// The renderer reads what single scattering loses from a table. Between its nodes bilinear
// interpolation is off by less than this share where roughness is at least 0.1 and the cosine at
// least 0.05 (AlbedoTable.interpolates_within_its_bound).
constexpr double table_error = 2.5e-3;

// A conductor gets back what single scattering loses, in proportion to its reflectance f0.
TEST(Furnace, RoughConductorsReflectTheirCompensatedAlbedo) {
  for (const double f0 : {0.3, 1.0}) {
    for (const double roughness : {0.1, 0.4, 0.7, 1.0}) {
      for (const double angle : {0.1, 1.2}) {
        const View view = tilted_plane(
            metal(glm::vec3(static_cast<float>(f0)), static_cast<float>(roughness)), angle);
        const Rendered result = render_clean(view, 32);
        const double cosine = std::cos(angle), alpha = roughness * roughness;
        const double gain = 1 + f0 * (1 / ggx_albedo(cosine, alpha, 1) - 1);
        // The quadrature's own error is below 1e-4 at these steps.
        EXPECT_NEAR(mean_mixed(result.layers), ggx_albedo(cosine, alpha, f0) * gain,
                    tolerance(result.layers) + 1e-4 + f0 * table_error)
            << "f0 " << f0 << " roughness " << roughness << " angle " << angle;
      }
    }
  }
}

scene::Material lacquered(scene::Material below, float roughness) {
  below.clearcoat = 0.8f;
  below.clearcoat_roughness = roughness;
  return below;
}

// On black, lacquer shows its own reflection; on white, what it does not reflect comes back, so
// that nothing is lost but what single scattering loses in rough lacquer.
TEST(Furnace, LacquerReflectsItsShareAndLeavesTheRest) {
  for (const double angle : {0.1, 1.2}) {
    const double cosine = std::cos(angle);
    const double share = 0.8 * truth::fresnel_dielectric(cosine, 1.5);
    const View black = tilted_plane(lacquered(diffuse(glm::vec3(0)), 0), angle);
    // The angle varies by 5e-4 over the picture; the slope of the reflectance is below 2.
    EXPECT_NEAR(mean_mixed(render_clean(black, 1).layers), share, 1e-3);
    for (const scene::Material& white : {diffuse(glm::vec3(1)), metal(glm::vec3(1), 0)}) {
      const Rendered smooth = render_clean(tilted_plane(lacquered(white, 0), angle), 16);
      EXPECT_NEAR(mean_mixed(smooth.layers), 1, tolerance(smooth.layers));
    }
    const Rendered rough =
        render_clean(tilted_plane(lacquered(diffuse(glm::vec3(1)), 0.5f), angle), 16);
    EXPECT_NEAR(mean_mixed(rough.layers), 1 - share + share * ggx_albedo(cosine, 0.25, 1),
                tolerance(rough.layers) + 1e-4);
  }
}

scene::Material rough_glass(float ior, float roughness, bool thin_walled) {
  scene::Material material = glass(ior);
  material.roughness = roughness;
  material.thin_walled = thin_walled;
  return material;
}

// What a pane does not reflect it lets through, whichever side light comes from.
TEST(Furnace, ARoughPaneTakesNothing) {
  for (const float roughness : {0.1f, 0.5f, 1.0f}) {
    for (const double angle : {0.1, 1.2}) {
      const View view = tilted_plane(rough_glass(1.5f, roughness, true), angle);
      const Rendered result = render_clean(view, 32);
      EXPECT_NEAR(mean_mixed(result.layers), 1, tolerance(result.layers) + table_error)
          << "roughness " << roughness << " angle " << angle;
    }
  }
}

// A solid takes nothing, either, at any of its vertices: each may be off by the table's error, and
// paths that are still inside when they end are lost.
TEST(Furnace, ARoughGlassBoxTakesNothing) {
  for (const float ior : {1.0f, 1.0001f, 1.5f, 2.5f}) {
    for (const float roughness : {0.1f, 0.5f, 1.0f}) {
      View view = empty_view({0.3, -3, 0.4}, {0, 0, 0}, pinhole(16, 16, 0.2), glm::vec3(1));
      add(view.scene, box_mesh({1, 1, 1}), rough_glass(ior, roughness, false));
      // Photons would be counted with the paths.
      const Rendered result =
          render_clean(view, 32, {.max_depth = 64, .caustics = set::Caustics::traced});
      const double samples = 32.0 * 16 * 16;
      const double vertices = static_cast<double>(result.counters.rays) / samples - 1;
      EXPECT_NEAR(mean_mixed(result.layers), 1, tolerance(result.layers) + vertices * table_error)
          << "ior " << ior << " roughness " << roughness;
    }
  }
}

// Glass that says metal, until its texture takes the metal away, is glass.
TEST(Furnace, GlassBelowATextureOfNoMetalTakesNothing) {
  scene::Material material = rough_glass(1.5f, 0.5f, false);
  material.metallic = 1;
  View view = empty_view({0.3, -3, 0.4}, {0, 0, 0}, pinhole(16, 16, 0.2), glm::vec3(1));
  material.metallic_roughness_texture = add_texture(view.scene, texture_of({1, 1, 0, 1}));
  add(view.scene, box_mesh({1, 1, 1}), material);
  const Rendered textured = render_clean(view, 8, up_to_depth(64));
  view.scene.materials[0].metallic_roughness_texture = scene::no_texture;
  view.scene.materials[0].metallic = 0;
  EXPECT_EQ(render_clean(view, 8, up_to_depth(64)).layers.mixed, textured.layers.mixed);
}

TEST(Furnace, ASmoothMirrorShowsSchlickAndTheEnvironmentBehindIt) {
  const double angle = 1.1;
  const Rendered result = render_clean(tilted_plane(metal(glm::vec3(0.5f), 0.0f), angle), 1);
  const double expected = 0.5 + 0.5 * std::pow(1 - std::cos(angle), 5);
  // One path, no chance in it; the angle varies by 5e-4 over the picture, the reflectance by less
  // than three times that.
  EXPECT_NEAR(mean_mixed(result.layers), expected, 1.5e-3);
}

// An instance that turns orientation around keeps its inside: a box refracts like its mirror image,
// which is the same box.
TEST(Furnace, MirroredGlassIsEnteredFromOutside) {
  const auto seen = [](double side) {
    View view = empty_view({1.2, -1.7, 1}, {0, 0, 0}, pinhole(24, 24, 0.6));
    glm::dmat4 placed(1.0);
    placed[0] *= side;
    add(view.scene, box_mesh({1, 1, 1}), glass(1.5f), placed);
    for (std::size_t i = 0; i < view.environment.radiance.size(); i += 3)
      view.environment.radiance[i] = glm::vec3(1, 2, 3);
    return mean(render_view(view, 64).layers.mixed);
  };
  const glm::dvec3 plain = seen(1), mirrored = seen(-1);
  // The same paths, and the box's coordinates have no rounding. A card may contract the products of
  // one and not those of the other, by a few roundings of 6e-8.
  if (!render::is_gpu(*shared_device())) {
    EXPECT_EQ(plain, mirrored);
  }
  expect_near(mirrored / plain, glm::dvec3(1), 1e-6);
}

// Lower plane emits 1 and reflects a, upper reflects b: L_lower = 1 + a b L_lower. The squares are
// 400 times as wide as their gap, so what escapes at the edges is below (1/400)^2 a bounce.
TEST(Furnace, TwoFacingPlanesSumTheirInterreflections) {
  scene::Material lower = diffuse(glm::vec3(0.8f));
  lower.emission = glm::vec3(1);
  View view = empty_view({0, 0, 0.05}, {0.01, 0, 0}, pinhole(24, 24, 0.4));
  view.scene = facing_planes(40, 0.1, lower, diffuse(glm::vec3(0.6f)));
  const Rendered result = render_clean(view, 32, up_to_depth(64));
  EXPECT_NEAR(mean_mixed(result.layers), 1 / (1 - 0.48), tolerance(result.layers) + 1e-4);
}

}  // namespace previz::test::furnace_test
