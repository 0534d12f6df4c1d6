// White furnaces: where the light around is the same from everywhere, what a surface shows has a
// closed form.
#include <numbers>

#include "tests/unit/render_fixture.hpp"

namespace previz::testing {
namespace {

constexpr double pi = std::numbers::pi;

// A large square at the origin in a uniform environment of radiance 1, seen under an angle from its
// normal by a camera whose picture is so narrow that the angle is the same in all of it.
View tilted_plane(const scene::Material& material, double angle_rad) {
  View view;
  const auto mesh = add_mesh(view.scene, rectangle_mesh({2, 2}));
  add_instance(view.scene, mesh, add_material(view.scene, material));
  view.environment = uniform_environment(glm::vec3(1));
  view.calibration = pinhole(32, 32, 1e-3);
  view.world_from_camera = look_at({0, -std::sin(angle_rad), std::cos(angle_rad)}, {0, 0, 0});
  return view;
}

double mean_mixed(const render::Layers& layers) {
  return mean(layers.mixed).g;
}

// Standard error of the picture's mean from the spread of its pixels, which see the same thing with
// independent scrambles.
double spread_error(const render::Layers& layers) {
  const double centre = mean_mixed(layers);
  double sum = 0;
  for (const glm::vec3& pixel : layers.mixed) sum += (pixel.g - centre) * (pixel.g - centre);
  const auto n = static_cast<double>(layers.mixed.size());
  return std::sqrt(sum / (n * (n - 1)));
}

// Four standard errors (one test in 16,000 fails by chance) and single precision.
double tolerance(const render::Layers& layers) {
  return 4 * spread_error(layers) + 1e-6;
}

TEST(Furnace, an_empty_scene_shows_the_environment_exactly) {
  View view;
  view.environment = uniform_environment(glm::vec3(0.25f, 0.5f, 2.0f));
  view.calibration = pinhole(33, 17, 0.9);
  const Rendered result = render_view(view, 3);
  for (const glm::vec3& pixel : result.layers.mixed) EXPECT_EQ(pixel, glm::vec3(0.25f, 0.5f, 2.0f));
  expect_clean(result.counters);
}

TEST(Furnace, lambert_reflects_its_albedo) {
  for (const float albedo : {0.0f, 0.5f, 1.0f}) {
    const Rendered result = render_view(tilted_plane(diffuse(glm::vec3(albedo)), 0.6), 16);
    EXPECT_NEAR(mean_mixed(result.layers), albedo, tolerance(result.layers));
    expect_clean(result.counters);
  }
}

// Inside a closed surface that emits 1 and reflects albedo: L = 1 + albedo L.
TEST(Furnace, a_closed_box_multiplies_its_own_light) {
  for (const float albedo : {0.0f, 0.5f}) {
    scene::Material wall = diffuse(glm::vec3(albedo));
    wall.emission = glm::vec3(1);
    View view;
    view.scene = furnace_box({2, 2, 2}, wall);
    view.environment = uniform_environment(glm::vec3(0));
    view.calibration = pinhole(24, 24, 1.2);
    view.world_from_camera = look_at({0.1, -0.2, 0.1}, {0.3, 0.9, 0.2});
    set::Estimation estimation;
    estimation.max_depth = 64;
    const Rendered result = render_view(view, 16, estimation);
    EXPECT_NEAR(mean_mixed(result.layers), 1 / (1 - albedo), tolerance(result.layers)) << albedo;
    expect_clean(result.counters);
  }
}

// Directional albedo of single-scatter GGX without Fresnel, by quadrature over the half vector's
// hemisphere (Walter et al. 2007; height-correlated Smith, Heitz 2014).
double ggx_albedo(double cos_o, double alpha) {
  const glm::dvec3 o(std::sqrt(1 - cos_o * cos_o), 0, cos_o);
  const auto lambda = [&](double z) {
    return 0.5 * (std::sqrt(1 + alpha * alpha * (1 - z * z) / (z * z)) - 1);
  };
  constexpr int steps = 2000;
  double sum = 0;
  for (int a = 0; a < steps; ++a) {
    // The half vector's tangent is alpha tan(pi u / 2): even steps where the lobe is.
    const double angle = (a + 0.5) / steps * pi / 2;
    const double tangent = alpha * std::tan(angle);
    const double z = 1 / std::sqrt(1 + tangent * tangent);
    const double dtheta = alpha / (std::cos(angle) * std::cos(angle)) * z * z * pi / 2 / steps;
    const double d = 1 / (pi * alpha * alpha * std::pow(z, 4) *
                          std::pow(1 + tangent * tangent / (alpha * alpha), 2));
    for (int b = 0; b < 400; ++b) {
      const double phi = (b + 0.5) / 400 * 2 * pi;
      const glm::dvec3 h(z * tangent * std::cos(phi), z * tangent * std::sin(phi), z);
      const double oh = glm::dot(o, h);
      const glm::dvec3 i = 2 * oh * h - o;
      if (oh <= 0 || i.z <= 0) continue;
      const double masking = 1 / (1 + lambda(cos_o) + lambda(i.z));
      // dw_i = 4 (o.h) dw_h
      sum += d * masking / (4 * cos_o) * 4 * oh * z * tangent * dtheta * 2 * pi / 400;
    }
  }
  return sum;
}

TEST(Furnace, ggx_reflects_its_single_scatter_albedo) {
  for (const double roughness : {0.1, 0.4, 0.7, 1.0}) {
    for (const double angle : {0.1, 1.2}) {
      const View view = tilted_plane(metal(glm::vec3(1), static_cast<float>(roughness)), angle);
      const Rendered result = render_view(view, 32);
      // The quadrature's own error is below 1e-4 at these steps.
      EXPECT_NEAR(mean_mixed(result.layers), ggx_albedo(std::cos(angle), roughness * roughness),
                  tolerance(result.layers) + 1e-4)
          << "roughness " << roughness << " angle " << angle;
      expect_clean(result.counters);
    }
  }
}

TEST(Furnace, a_smooth_mirror_shows_schlick_and_the_environment_behind_it) {
  const double angle = 1.1;
  const Rendered result = render_view(tilted_plane(metal(glm::vec3(0.5f), 0.0f), angle), 1);
  const double expected = 0.5 + 0.5 * std::pow(1 - std::cos(angle), 5);
  // One path, no chance in it; the angle varies by 5e-4 over the picture, the reflectance by less
  // than three times that.
  EXPECT_NEAR(mean_mixed(result.layers), expected, 1.5e-3);
  expect_clean(result.counters);
}

TEST(Furnace, glass_takes_nothing) {
  for (const float ior : {1.0f, 1.0001f, 1.5f, 2.5f}) {
    View view;
    const auto slab = add_mesh(view.scene, box_mesh({4, 4, 0.5}));
    add_instance(view.scene, slab, add_material(view.scene, glass(ior)));
    view.environment = uniform_environment(glm::vec3(1));
    view.calibration = pinhole(24, 24, 0.6);
    view.world_from_camera = look_at({0.3, -0.4, 3}, {0, 0, 0});
    set::Estimation estimation;
    estimation.max_depth = 64;
    const Rendered result = render_view(view, 4, estimation);
    for (const glm::vec3& pixel : result.layers.mixed) EXPECT_NEAR(pixel.g, 1, 1e-5) << ior;
    expect_clean(result.counters);
  }
}

// Lower plane emits 1 and reflects a, upper reflects b: L_lower = 1 + a b L_lower. The squares are
// 400 times as wide as their gap, so what escapes at the edges is below (1/400)^2 a bounce.
TEST(Furnace, two_facing_planes_sum_their_interreflections) {
  scene::Material lower = diffuse(glm::vec3(0.8f));
  lower.emission = glm::vec3(1);
  View view;
  view.scene = facing_planes(40, 0.1, lower, diffuse(glm::vec3(0.6f)));
  view.environment = uniform_environment(glm::vec3(0));
  view.calibration = pinhole(24, 24, 0.4);
  view.world_from_camera = look_at({0, 0, 0.05}, {0.01, 0, 0});
  set::Estimation estimation;
  estimation.max_depth = 64;
  const Rendered result = render_view(view, 32, estimation);
  EXPECT_NEAR(mean_mixed(result.layers), 1 / (1 - 0.48), tolerance(result.layers) + 1e-4);
  expect_clean(result.counters);
}

}  // namespace
}  // namespace previz::testing
