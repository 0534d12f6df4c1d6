// White furnaces at the ends of the materials' ranges: what goes in comes out, to 1e-3.
#include "tests/extremes/every_way.hpp"

namespace previz::test::furnace_test {

constexpr double energy = 1e-3;  // the bound of shaders/README.md, "Numerical extremes"

// A plane seen from three angles in an environment of radiance 1. Where directions are chosen by
// the BSDF alone, there is little chance in it; with light samples, four standard errors.
void expect_reflectance(const scene::Material& material, double expected) {
  View view = empty_view({0, 0, 1}, {0, 0, 0}, pinhole(16, 16, 0.02), glm::vec3(1));
  add(view.scene, rectangle_mesh({2, 2}), material);
  SetRenderer renderer(view);
  for (const auto sampling : {set::LightSampling::bsdf, set::LightSampling::importance}) {
    renderer.set_environment(view.environment, sampling);
    for (const double angle : {0.0, 0.8, 1.5}) {
      renderer.world_from_camera = look_at({0, -std::sin(angle), std::cos(angle)}, {0, 0, 0});
      const render::Layers layers = renderer.rendered(8);
      const bool sure = sampling == set::LightSampling::bsdf;
      EXPECT_NEAR(mean(layers.mixed).g, expected,
                  sure ? energy : 4 * standard_error_of_pixels(layers) + 1e-5)
          << "angle " << angle << (sure ? ", by the BSDF" : ", with light samples");
    }
  }
  expect_clean(renderer.counters());
}

TEST(ExtremeFurnace, LambertReflectsItsAlbedo) {
  for (const float albedo : {0.0f, 0.5f, 1.0f})
    expect_reflectance(diffuse(glm::vec3(albedo)), albedo);
}

TEST(ExtremeFurnace, AWhiteMirrorTakesNothing) {
  for (const float roughness : {0.0f, 1e-4f}) {
    SCOPED_TRACE(roughness);
    expect_reflectance(metal(glm::vec3(1), roughness), 1);
  }
}

// The coat's Fresnel share and the rest for the white base: together 1. At an index of 1 there is
// no coat, whatever its roughness.
TEST(ExtremeFurnace, WhitePlasticTakesNothing) {
  for (const float roughness : {0.0f, 1e-4f}) {
    for (const float ior : {1.0001f, 2.5f}) {
      SCOPED_TRACE("ior " + std::to_string(ior) + ", roughness " + std::to_string(roughness));
      expect_reflectance(plastic(glm::vec3(1), roughness, ior), 1);
    }
  }
  expect_reflectance(plastic(glm::vec3(1), 1, 1), 1);
}

TEST(ExtremeFurnace, BlackPlasticReflectsItsCoatAlone) {
  View view = empty_view({0, 0, 1}, {0, 0, 0}, pinhole(16, 16, 1e-3), glm::vec3(1));
  add(view.scene, rectangle_mesh({2, 2}), plastic(glm::vec3(0), 0, 2.5f));
  const Rendered result = render_clean(view, 1, up_to_depth(64));
  const double f0 = std::pow((2.5 - 1) / (2.5 + 1), 2);
  EXPECT_NEAR(mean(result.layers.mixed).g, f0, 1e-6);  // one path, no chance in it
}

// A slab and a ball, so that rays enter and leave at every angle.
TEST(ExtremeFurnace, ClearGlassTakesNothing) {
  for (const float ior : {1.0f, 1.0001f, 1.5f, 2.5f}) {
    for (const bool thin : {false, true}) {
      for (const scene::Mesh& mesh : {box_mesh({4, 4, 0.5}), icosphere_mesh(1, 5)}) {
        View view = empty_view({0.3, -0.4, 3}, {0, 0, 0}, pinhole(16, 16, 0.8), glm::vec3(1));
        add(view.scene, mesh, thin ? pane(glm::vec3(1), ior) : glass(ior));
        const Rendered result = render_clean(view, 4, up_to_depth(64));
        for (const glm::vec3& pixel : result.layers.mixed)
          EXPECT_NEAR(pixel.g, 1, 1e-5) << ior << ' ' << mesh.name << (thin ? " thin" : "");
      }
    }
  }
}

// Opaque to what enters, so what is left is the outer reflection, at normal incidence f0.
TEST(ExtremeFurnace, BlackGlassReflectsItsSurfaceAlone) {
  for (const float ior : {1.0f, 1.0001f, 2.5f}) {
    View view = empty_view({0, 0, 3}, {0, 0, 0}, pinhole(16, 16, 1e-3), glm::vec3(1));
    scene::Material material = glass(ior);
    material.base_color = glm::vec3(0);
    add(view.scene, box_mesh({4, 4, 0.5}), material);
    const Rendered result = render_clean(view, 64, up_to_depth(64));
    const double f0 = std::pow((ior - 1.0) / (ior + 1.0), 2);
    // The choice between the lobes is a coin of 16 * 16 * 64 tosses.
    EXPECT_NEAR(mean(result.layers.mixed).g, f0, 4 * std::sqrt(f0 * (1 - f0) / 16384) + 1e-6);
  }
}

// Inside a closed surface that emits 1 and reflects albedo a, the first hit and 64 bounces bring
// 1 + a + a^2 + ... + a^64.
TEST(ExtremeFurnace, SixtyFourBouncesAddUp) {
  for (const float albedo : {0.0f, 0.5f, 1.0f}) {
    scene::Material wall = diffuse(glm::vec3(albedo));
    wall.emission = glm::vec3(1);
    View view = empty_view({0.1, -0.2, 0.1}, {0.3, 0.9, 0.2}, pinhole(32, 32, 1.2));
    view.scene = furnace_box({2, 2, 2}, wall);
    const Rendered result = render_clean(view, 32, up_to_depth(64));
    double expected = 0;
    for (int bounce = 0; bounce <= 64; ++bounce) expected += std::pow(albedo, bounce);
    EXPECT_NEAR(mean(result.layers.mixed).g, expected,
                4 * standard_error_of_pixels(result.layers) + 1e-5 * expected);
    EXPECT_LT(standard_error_of_pixels(result.layers), energy * expected);
  }
}

// A virtual ball of each material at its end, none of which takes light, on a real white floor in a
// white environment: nothing of it can be seen, and it casts no shadow.
class FurnaceByEveryWay : public EveryWay {};
INSTANTIATE_TEST_SUITE_P(Ways, FurnaceByEveryWay, testing::Values(paired, difference, by_camera),
                         name_of_way);

TEST_P(FurnaceByEveryWay, AWhiteBallOnAWhiteFloorIsNotSeen) {
  for (const scene::Material& material :
       {diffuse(glm::vec3(1)), metal(glm::vec3(1), 0), metal(glm::vec3(1), 1e-4f),
        plastic(glm::vec3(1), 0, 2.5f), glass(1.0001f), glass(2.5f), pane(glm::vec3(1), 2.5f)}) {
    View view = empty_view({0, -1.5, 1}, {0, 0, 0.2}, pinhole(24, 18, 0.6), glm::vec3(1));
    add(view.scene, rectangle_mesh({8, 8}), diffuse(glm::vec3(1)));
    add(view.scene, icosphere_mesh(0.3, 3), material, at({0, 0, 0.3}), scene::world_mixed);
    const Seen white{{24, 18, 16, std::vector<std::uint16_t>(3 * 24 * 18, 32768)}, 32768.0 / 65535};
    const render::Layers layers =
        render_by(GetParam(), view, white, 16, {.max_depth = 64, .caustics = set::Caustics::traced})
            .layers;
    // The pixels' errors are independent of each other.
    EXPECT_NEAR(mean(layers.mixed).g, 1, 4 * standard_error_of_pixels(layers) + energy);
    EXPECT_NEAR(mean(layers.composite).g, 1, 4 * standard_error_of_pixels(layers) + energy);
    EXPECT_LT(standard_error_of_pixels(layers), 0.02) << "too noisy to say anything";
  }
}

}  // namespace previz::test::furnace_test
