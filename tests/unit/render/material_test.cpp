// Cloth, brushed metal and coloured gloss against closed forms: in the light of one distant lamp,
// where nothing is left to chance, and in white furnaces.
#include "tests/support/render_fixture.hpp"
#include "tests/truth/cpu_bsdf.hpp"

namespace previz::test::material_test {

constexpr double pi = std::numbers::pi;

glm::dvec3 direction(double angle_rad, double azimuth_rad) {
  return {std::sin(angle_rad) * std::cos(azimuth_rad), std::sin(angle_rad) * std::sin(azimuth_rad),
          std::cos(angle_rad)};
}

// A plane z = 0, seen from a direction by so narrow a camera that it is the same in all of the
// picture, in the dark. Its textures' +X and +Y are the world's.
View plane_seen_from(const glm::dvec3& o, const scene::Material& material) {
  View view = empty_view(o, {0, 0, 0}, pinhole(8, 8, 1e-4));
  add(view.scene, rectangle_mesh({2, 2}), material);
  return view;
}

// Returns f * cos for light from the direction i.
glm::dvec3 scattered(View view, const glm::dvec3& i) {
  view.scene.lights.push_back(lamp(set::LightType::directional));
  view.scene.lights.back().direction = -i;
  return mean(render_clean(view, 1).layers.mixed);
}

Rendered in_white_furnace(View view, int samples) {
  view.environment = uniform_environment(glm::vec3(1));
  view.calibration = pinhole(32, 32, 1e-4);
  return render_clean(view, samples);
}

// Four standard errors (one test in 16,000 fails by chance) and single precision.
double chance(const render::Layers& layers) {
  return 4 * standard_error_of_pixels(layers) + 1e-6;
}

// Over a picture 1e-4 rad wide the sharpest of these lobes changes by less than this, relatively: a
// tenth of a degree off its peak, where the slope of its logarithm is at most 20.
constexpr double over_the_picture = 1e-3;
// The relative errors of bilinear interpolation in the tables (AlbedoTable.*).
constexpr double sheen_table_error = 4e-3;
constexpr double anisotropic_table_error = 6e-3;

// KHR_materials_sheen's formula, times the cosine of the light's direction, for white sheen.
double sheen_formula(const glm::dvec3& o, const glm::dvec3& i, double roughness) {
  const double alpha = roughness * roughness;
  const auto lambda = [&](double cosine) {
    const double t = (1 - alpha) * (1 - alpha);
    const auto l = [&](double x) {
      const double a = std::lerp(21.5473, 25.3245, t), b = std::lerp(3.82987, 3.32435, t);
      const double c = std::lerp(0.19823, 0.16801, t), d = std::lerp(-1.97760, -1.27393, t);
      return a / (1 + b * std::pow(x, c)) + d * x + std::lerp(-4.32054, -4.85967, t);
    };
    return std::exp(cosine < 0.5 ? l(cosine) : 2 * l(0.5) - l(1 - cosine));
  };
  const double cos_h = glm::normalize(o + i).z;
  const double d = (2 + 1 / alpha) * std::pow(1 - cos_h * cos_h, 0.5 / alpha) / (2 * pi);
  return d / ((1 + lambda(o.z) + lambda(i.z)) * 4 * o.z * i.z) * i.z;
}

// Its integral over all directions of the light.
double sheen_albedo(double cosine, double roughness) {
  constexpr int rings = 150, spokes = 60;
  const glm::dvec3 o = direction(std::acos(cosine), 0);
  double sum = 0;
  for (int ring = 0; ring < rings; ++ring) {
    const double root = (ring + 0.5) / rings;
    for (int spoke = 0; spoke < spokes; ++spoke)
      sum += 2 * root *
             sheen_formula(o, direction(std::acos(root * root), (spoke + 0.5) / spokes * pi),
                           roughness);
  }
  return sum * 2 * pi / (rings * spokes);
}

scene::Material under_sheen(scene::Material below, const glm::vec3& color, float roughness) {
  below.sheen_color = color;
  below.sheen_roughness = roughness;
  return below;
}

TEST(Sheen, ShinesByItsFormula) {
  const glm::vec3 color(0.8f, 0.5f, 0.2f);
  const glm::dvec3 o = direction(1.1, 0.3);
  for (const float roughness : {0.3f, 0.6f, 1.0f}) {
    const View view = plane_seen_from(o, under_sheen(diffuse(glm::vec3(0)), color, roughness));
    for (const double azimuth : {0.2, 1.4, 2.9}) {
      const glm::dvec3 i = direction(0.9, azimuth);
      const glm::dvec3 expected = glm::dvec3(color) * sheen_formula(o, i, roughness);
      const glm::dvec3 measured = scattered(view, i);
      SCOPED_TRACE(testing::Message() << "roughness " << roughness << " azimuth " << azimuth);
      expect_near(measured, expected, over_the_picture * expected);
    }
  }
}

// What is below gets what the direction in which sheen shines more leaves, of the viewer's and the
// light's; so it looks the same from either end.
TEST(Sheen, LeavesTheRestToWhatIsBelow) {
  const float roughness = 0.5f;
  const glm::dvec3 ends[] = {direction(0.4, 0.3), direction(1.3, 2.0)};
  const double left = 1 - 0.9 * sheen_albedo(ends[1].z, roughness);
  glm::dvec3 seen[2];
  for (int end = 0; end < 2; ++end) {
    const glm::dvec3 &o = ends[end], &i = ends[1 - end];
    const View view = plane_seen_from(
        o, under_sheen(diffuse(glm::vec3(0.6f)), glm::vec3(0.9f, 0.1f, 0.5f), roughness));
    seen[end] = scattered(view, i) / i.z;
    const double shine = sheen_formula(o, i, roughness) / i.z;
    const glm::dvec3 expected = 0.6 / pi * left + glm::dvec3(0.9, 0.1, 0.5) * shine;
    SCOPED_TRACE(end);
    expect_near(seen[end], expected,
                over_the_picture * expected + 0.6 / pi * 0.9 * sheen_table_error);
  }
  EXPECT_NEAR(seen[0].g, seen[1].g, 2 * over_the_picture * seen[0].g);
}

// White sheen on white: what is lost is what the smaller of the two shares leaves out.
TEST(Sheen, GainsNothingAndLosesWhatItsScalingLoses) {
  constexpr int steps = 100;
  for (const double roughness : {0.3, 0.6, 1.0}) {
    std::vector<double> shares;
    for (int k = 0; k < steps; ++k) shares.push_back(sheen_albedo((k + 0.5) / steps, roughness));
    for (const double angle : {0.1, 1.2, 1.45}) {
      const glm::dvec3 o = direction(angle, 0);
      const double share = sheen_albedo(o.z, roughness);
      double below = 0;  // the integral of the smaller share times cos / pi
      for (int k = 0; k < steps; ++k)
        below += 2 * (k + 0.5) / (steps * steps) *
                 (1 - std::max(share, shares[static_cast<std::size_t>(k)]));
      const auto seen = [&](const scene::Material& base) {
        return in_white_furnace(
            plane_seen_from(o, under_sheen(base, glm::vec3(1), static_cast<float>(roughness))), 32);
      };
      const Rendered matt = seen(diffuse(glm::vec3(1)));
      EXPECT_NEAR(mean(matt.layers.mixed).g, share + below, chance(matt.layers) + sheen_table_error)
          << "roughness " << roughness << " angle " << angle;
      EXPECT_LT(mean(matt.layers.mixed).g, 1 + chance(matt.layers) + sheen_table_error);
      // A mirror's two directions lose alike, so nothing is lost.
      const Rendered mirror = seen(metal(glm::vec3(1), 0));
      EXPECT_NEAR(mean(mirror.layers.mixed).g, 1, chance(mirror.layers) + sheen_table_error)
          << "roughness " << roughness << " angle " << angle;
    }
  }
}

// Close to grazing the formula of smooth sheen sends back more than it gets.
TEST(Sheen, OfLittleRoughnessGainsNothing) {
  for (const float roughness : {0.0f, 0.1f, 0.2f}) {
    for (const double angle : {1.4, 1.52, 1.56}) {
      for (const float base : {0.0f, 1.0f}) {
        const View view = plane_seen_from(
            direction(angle, 0), under_sheen(diffuse(glm::vec3(base)), glm::vec3(1), roughness));
        const Rendered result = in_white_furnace(view, 64);
        // The table of its albedo is off by up to 2 % there (AlbedoTable.OfSheen*).
        EXPECT_LT(mean(result.layers.mixed).g, 1 + chance(result.layers) + 0.02)
            << "roughness " << roughness << " angle " << angle << " base " << base;
      }
    }
  }
}

TEST(Sheen, LiesBelowLacquer) {
  scene::Material coated = under_sheen(diffuse(glm::vec3(0)), glm::vec3(0.7f), 0.5f);
  const glm::dvec3 o = direction(1.1, 0.3), i = direction(0.8, 0.9);
  const double bare = scattered(plane_seen_from(o, coated), i).g;
  coated.clearcoat = 0.8f;  // smooth: it mirrors the dark
  const double share = 0.8 * truth::fresnel_dielectric(o.z, 1.5);
  EXPECT_NEAR(scattered(plane_seen_from(o, coated), i).g, (1 - share) * bare,
              over_the_picture * bare);
}

scene::Material brushed(scene::Material material, float strength, float rotation) {
  material.anisotropy = strength;
  material.anisotropy_rotation_rad = rotation;
  return material;
}

// Plastic, whose lobe is GGX alone: Fr D G2 / (4 nv), for facets that are spread by `along` in the
// direction t and by `across` across it.
double coat_formula(const glm::dvec3& o, const glm::dvec3& i, const glm::dvec3& t, double along,
                    double across) {
  const glm::dvec3 b = glm::cross(glm::dvec3(0, 0, 1), t);
  const auto lambda = [&](const glm::dvec3& w) {
    const double x = along * glm::dot(w, t), y = across * glm::dot(w, b);
    return 0.5 * (std::sqrt(1 + (x * x + y * y) / (w.z * w.z)) - 1);
  };
  const glm::dvec3 h = glm::normalize(o + i);
  const double d =
      std::pow(glm::dot(h, t) / along, 2) + std::pow(glm::dot(h, b) / across, 2) + h.z * h.z;
  return truth::fresnel_dielectric(o.z, 1.5) / (pi * along * across * d * d) /
         (1 + lambda(o) + lambda(i)) / (4 * o.z);
}

// The wider direction follows the texture coordinates, also where the instance is a mirror image,
// and turns from +X to +Y.
TEST(BrushedMetal, IsWiderAlongTheTexture) {
  const double roughness = 0.4, strength = 0.7, across = roughness * roughness;
  const double along = std::lerp(across, 1.0, strength * strength);
  const glm::dvec3 o = direction(0.7, 0.4), i = direction(0.5, 2.6);
  for (const double rotation : {0.0, 0.6, -0.6, 2.0}) {
    for (const bool mirrored : {false, true}) {
      View view = plane_seen_from(
          o, brushed(plastic(glm::vec3(0), 0.4f), 0.7f, static_cast<float>(rotation)));
      if (mirrored) view.scene.instances[0].world_from_object[0] *= -1.0;
      const glm::dvec3 t((mirrored ? -1 : 1) * std::cos(rotation), std::sin(rotation), 0);
      const double expected = coat_formula(o, i, t, along, across);
      EXPECT_NEAR(scattered(view, i).g, expected, over_the_picture * expected)
          << "rotation " << rotation << (mirrored ? ", mirrored" : "");
    }
  }
}

TEST(BrushedMetal, WithoutTextureCoordinatesIsWiderInSomeDirection) {
  View view = plane_seen_from(direction(0.7, 0.4), brushed(metal(glm::vec3(1), 0.3f), 0.7f, 0));
  view.scene.meshes[0].uvs.clear();
  const Rendered result = in_white_furnace(view, 16);
  EXPECT_NEAR(mean(result.layers.mixed).g, 1, chance(result.layers) + anisotropic_table_error);
}

// White metal gets back all that single scattering loses, at any azimuth.
TEST(BrushedMetal, TakesNothing) {
  for (const auto& [roughness, strength] :
       {std::pair{0.3f, 0.6f}, std::pair{0.2f, 0.5f}, std::pair{0.5f, 1.0f}}) {
    for (const double angle : {0.1, 0.8, 1.3}) {
      for (const double azimuth : {0.0, 0.9, 1.5}) {
        const View view = plane_seen_from(direction(angle, azimuth),
                                          brushed(metal(glm::vec3(1), roughness), strength, 0));
        const Rendered result = in_white_furnace(view, 16);
        EXPECT_NEAR(mean(result.layers.mixed).g, 1, chance(result.layers) + anisotropic_table_error)
            << "roughness " << roughness << " strength " << strength << " angle " << angle
            << " azimuth " << azimuth;
      }
    }
  }
}

// A mirror that is brushed is none: its highlight is a line.
TEST(BrushedMetal, IsNoMirror) {
  scene::Scene scene;
  EXPECT_TRUE(scene::can_be_dirac(scene, metal(glm::vec3(1), 0), 1e-3));
  EXPECT_FALSE(scene::can_be_dirac(scene, brushed(metal(glm::vec3(1), 0), 0.2f, 0), 1e-3));
  EXPECT_TRUE(scene::can_be_dirac(scene, brushed(metal(glm::vec3(1), 0), 0.02f, 0), 1e-3));
  const View view =
      plane_seen_from(direction(0.8, 0.3), brushed(metal(glm::vec3(1), 0), 0.5f, 0.4f));
  const Rendered result = in_white_furnace(view, 16);
  // 0.015: the bound of its albedo's table (AlbedoTable.OfAnisotropy*).
  EXPECT_NEAR(mean(result.layers.mixed).g, 1, chance(result.layers) + 0.015);
}

// At normal incidence the reflectance is 4 % of the colour, towards grazing that of white gloss.
// White paint below gets what the strongest channel leaves.
TEST(ColouredGloss, FadesTowardsGrazing) {
  scene::Material gloss = plastic(glm::vec3(1), 0);
  gloss.specular = 0.9f;
  gloss.specular_color = {1, 0.25f, 0};
  for (const double angle : {0.0, 0.9, 1.4}) {
    const double fresnel = truth::fresnel_dielectric(std::cos(angle), 1.5);
    const glm::dvec3 f0 = 0.04 * glm::dvec3(gloss.specular_color);
    const glm::dvec3 coat = 0.9 * (f0 + (1.0 - f0) * ((fresnel - 0.04) / 0.96));
    const Rendered result = in_white_furnace(plane_seen_from(direction(angle, 0.2), gloss), 32);
    SCOPED_TRACE(angle);
    expect_near(mean(result.layers.mixed), 1 - coat.r + coat,
                4.0 * standard_errors_of_pixels(result.layers) + over_the_picture * coat.r + 1e-6);
  }
}

// The reflectance at normal incidence is at most 1.
TEST(ColouredGloss, TakesColoursAboveOne) {
  scene::Material gloss = plastic(glm::vec3(0), 0);
  gloss.specular_color = {100, 10, 0};
  const View view = plane_seen_from({0, 0, 1}, gloss);
  const glm::dvec3 seen = mean(in_white_furnace(view, 1).layers.mixed);
  expect_near(seen, {1, 0.4, 0}, 1e-5);
}

}  // namespace previz::test::material_test
