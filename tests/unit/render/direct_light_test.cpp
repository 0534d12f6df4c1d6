// Direct light of every kind of lamp on a Lambert plane, against closed forms.
#include "daemon/core/scene/placement.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::direct_light_test {

constexpr double pi = std::numbers::pi;
constexpr double albedo = 0.6;

const glm::dvec3 colour(2, 3, 5);

// Mean of the picture against emission * factor, within four standard errors plus `bias`, the share
// by which the picture's 1 mm extent and single precision may move it.
void expect_radiance(const View& view, const glm::dvec3& expected, double bias = 2e-4) {
  const Rendered result = render_clean(view, 64, up_to_depth(1));
  const glm::dvec3 measured = mean(result.layers.mixed);
  const double relative_error = standard_error_of_pixels(result.layers) / measured.g;
  expect_near(measured / expected, glm::dvec3(1), 4 * relative_error + bias);
  EXPECT_EQ(mean(result.layers.diff), glm::dvec3(0));  // the same light in both worlds
}

View lit_by(const set::Light& light) {
  View view = lit_point(albedo);
  view.scene.lights = {light};
  return view;
}

TEST(DirectLight, Point) {
  const set::Light light = point_lamp({1, 1, 2}, colour);
  const double d2 = 6;
  expect_radiance(lit_by(light), albedo / pi * light.emission * (2 / std::sqrt(d2)) / d2, 1e-3);
}

// One texel that turns the normal towards `tangent` (+X along u, +Y up the picture, against v).
void map_normal(View& view, const glm::dvec3& tangent) {
  const std::uint32_t index =
      add_texture(view.scene, texture_of(glm::vec4(glm::vec3(0.5 * tangent + 0.5), 1)));
  view.scene.materials[view.scene.instances[0].material].normal_texture = index;
}

// World direction in which u (0) or v (1) of the plane's mesh grows.
glm::dvec3 grows(const scene::Mesh& mesh, int coordinate) {
  glm::dvec3 direction(0);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    direction += glm::dvec3(mesh.positions[i]) * (mesh.uvs[i][coordinate] - 0.5);
  return glm::normalize(direction);
}

// The cosine at the mapped normal, with the plane facing the camera and turned away from it.
TEST(DirectLight, OnANormalMap) {
  const glm::dvec3 tangent = glm::normalize(glm::dvec3(0.3, 0.5, 0.9));
  for (const bool mirrored : {false, true}) {
    View view = lit_point(albedo);
    if (mirrored) view.scene.instances[0].world_from_object[0] *= -1.0;
    const scene::Mesh& mesh = view.scene.meshes[0];
    const glm::dvec3 u = (mirrored ? -1.0 : 1.0) * grows(mesh, 0);
    const glm::dvec3 normal =
        tangent.x * u - tangent.y * grows(mesh, 1) + tangent.z * glm::dvec3(0, 0, 1);
    map_normal(view, tangent);
    SCOPED_TRACE(mirrored ? "mirrored" : "as it is");
    const set::Light light = sun_lamp(-glm::normalize(glm::dvec3(0.2, -0.4, 0.7)), 0, colour);
    view.scene.lights.push_back(light);
    // A half has 11 bits: the texel's error of 2^-11 in each of three components.
    expect_radiance(view, albedo / pi * light.emission * glm::dot(normal, -light.direction), 2e-3);
  }
}

TEST(DirectLight, SpotInsideAndBetweenItsCones) {
  set::Light light = lamp(set::LightType::spot, colour);
  light.position = {0, 0, 2};
  const double off_axis = 0.4;
  light.direction = {std::sin(off_axis), 0, -std::cos(off_axis)};
  light.inner_cone_rad = 0.2;
  light.outer_cone_rad = 0.6;
  const double x = (std::cos(off_axis) - std::cos(0.6)) / (std::cos(0.2) - std::cos(0.6));
  const double falloff = x * x * (3 - 2 * x);
  expect_radiance(lit_by(light), albedo / pi * light.emission * falloff / 4.0, 2e-3);
}

TEST(DirectLight, DirectionalAsAPointAndAsADisc) {
  for (const double radius : {0.0, 0.00465, 0.2}) {
    const set::Light light = sun_lamp(glm::normalize(glm::dvec3(0.5, 0.2, -1)), radius, colour);
    // A uniform disc around the direction brings E cos(theta), whatever its size, while all of it
    // is above the plane.
    expect_radiance(lit_by(light), albedo / pi * light.emission * -light.direction.z);
  }
}

TEST(DirectLight, Sphere) {
  const set::Light light = sphere_lamp({1, 0.5, 2}, 0.7, colour);
  // Irradiance pi L (r/d)^2 cos(theta) of a sphere wholly above the horizon.
  const double d2 = 5.25;
  expect_radiance(lit_by(light), albedo * light.emission * 0.49 / d2 * (2 / std::sqrt(d2)), 1e-3);
}

// Form factor of a rectangle a x b to an element below its corner, parallel, at distance c.
double corner_form_factor(double a, double b, double c) {
  const double x = a / c, y = b / c;
  const double p = std::sqrt(1 + x * x), q = std::sqrt(1 + y * y);
  return (x / p * std::atan(y / p) + y / q * std::atan(x / q)) / (2 * pi);
}

TEST(DirectLight, Rectangle) {
  const set::Light light = panel_lamp({0, 0, 1.5}, {1.2, 0.8}, colour);
  expect_radiance(lit_by(light), albedo * light.emission * 4.0 * corner_form_factor(0.6, 0.4, 1.5),
                  1e-3);
}

TEST(DirectLight, EmissiveMeshIsTheSameAsARectangle) {
  View view = lit_point(albedo);
  add(view.scene, rectangle_mesh({1.2, 0.8}), emitter(glm::vec3(colour)), at({0, 0, 1.5}));
  expect_radiance(view, albedo * colour * 4.0 * corner_form_factor(0.6, 0.4, 1.5), 1e-3);
}

TEST(DirectLight, ATintScalesTheMixedWorldChannelByChannel) {
  set::Light light = point_lamp({0, 0, 2}, colour);
  light.gain_mixed = 0.5;
  light.tint = {2, 0.5, 0};
  for (const auto estimator : both_estimators) {
    const Rendered result = render_clean(lit_by(light), 4, {.estimator = estimator});
    const glm::dvec3 full = albedo / pi * colour / 4.0;
    expect_near(mean(result.layers.diff) / full, 0.5 * light.tint - 1.0, 1e-3);
    if (estimator == set::Estimator::difference) continue;
    expect_near(mean(result.layers.mixed) / full, 0.5 * light.tint, 1e-3);
    expect_near(mean(result.layers.real) / full, glm::dvec3(1), 1e-3);
  }
}

TEST(DirectLight, AGainScalesItsWorldOnly) {
  set::Light light = point_lamp({0, 0, 2}, colour);
  light.gain_mixed = 0.25;
  const Rendered result = render_clean(lit_by(light), 4);
  const double full = albedo / pi * 3 / 4;
  EXPECT_NEAR(mean(result.layers.mixed).g / full, 0.25, 1e-3);
  EXPECT_NEAR(mean(result.layers.real).g / full, 1, 1e-3);
}

// A real lamp whose colour is changed: it is taken away, and one of the other colour added.
TEST(DirectLight, ARecolouredLampIsOneTakenAwayAndOneAdded) {
  View view = lit_point(albedo);
  set::Light taken = panel_lamp({0, 0, 1.5}, {1, 1}, colour), light = taken;
  taken.gain_mixed = 0;
  light.emission = {5, 3, 2};
  light.gain_real = 0;
  view.scene.lights = {taken, light};
  const render::Layers layers = render_clean(view, 64, up_to_depth(1)).layers;
  const double brought = albedo * 4.0 * corner_form_factor(0.5, 0.5, 1.5);
  const double error = standard_error_of_pixels(layers) / mean(layers.mixed).g;
  expect_near(mean(layers.mixed) / (brought * light.emission), glm::dvec3(1), 4 * error + 1e-3);
  expect_near(mean(layers.real) / (brought * colour), glm::dvec3(1), 4 * error + 1e-3);
}

// The crew's tint of a real lamp, as live and offline apply it. Another lamp shines as well, so
// that light samples have a choice between them.
View tinted(const glm::dvec3& tint, double gain) {
  View view = lit_point(albedo);
  set::Light fill = point_lamp({1, 1, 2}, colour), key = point_lamp({0, 0, 2}, colour);
  fill.name = "fill";
  key.name = "key";
  view.scene.lights = {fill, key};
  set::Set set;
  set.lights = view.scene.lights;
  session::SceneState state;
  state.lights["key"] = scene::state_of(key);
  state.lights["key"]->gain_mixed = gain;
  state.lights["key"]->tint = tint;
  view.scene.lights = scene::place(view.scene, set, state).lights;
  return view;
}

// Where a lamp is 7 % redder, nothing may be noisier than where it is 7 % brighter: the red channel
// is the same to the last bit, and the others do not differ between the worlds at all.
TEST(DirectLight, ATintIsNoNoisierThanAGain) {
  for (const auto estimator : both_estimators) {
    const set::Estimation estimation = up_to_depth(1, estimator);
    const render::Layers gained = render_clean(tinted(glm::dvec3(1), 1.07), 16, estimation).layers;
    const render::Layers tint =
        render_clean(tinted(glm::dvec3(1.07, 1, 1), 1), 16, estimation).layers;
    for (std::size_t i = 0; i < tint.diff.size(); ++i) {
      ASSERT_EQ(tint.diff[i].r, gained.diff[i].r) << i;
      ASSERT_EQ(tint.diff[i].g, 0) << i;
      ASSERT_EQ(tint.diff[i].b, 0) << i;
    }
    // The key brings E = I / d^2 to the plane; a half of the samples is the key's, more or less.
    const double expected = 0.07 * albedo / pi * colour.r / 4;
    EXPECT_NEAR(mean(tint.diff).r / expected, 1, 0.01);
  }
}

}  // namespace previz::test::direct_light_test
