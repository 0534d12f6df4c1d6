// The GPU renderer against the independent CPU tracer, both radiances, at reduced size: on sets
// varied by seed (camera, objects diffuse, textured, plastic, rough and smooth metal, emitter,
// removed, lamps, lens) and on the ground truth sets.
#include <filesystem>
#include <string>

#include "daemon/lighting/lighting.hpp"
#include "tests/support/figure.hpp"
#include "tests/support/render_fixture.hpp"
#include "tests/support/shared_data.hpp"
#include "tests/truth/agreement.hpp"
#include "tests/truth/cpu_camera.hpp"
#include "tests/truth/cpu_tracer.hpp"
#include "tests/truth/truth_set.hpp"

namespace previz::test {
namespace renderer_agreement_test {

constexpr int scrambles = 16;

struct Worlds {
  truth::Scrambles mixed, real;
};

std::vector<glm::dvec3> widen(const std::vector<glm::vec3>& layer) {
  return {layer.begin(), layer.end()};
}

Worlds sized(const View& view) {
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  return {{k.width, k.height, {}}, {k.width, k.height, {}}};
}

Worlds gpu_scrambles(const View& view, int samples, bool caustics, std::uint32_t first_seed,
                     const std::vector<scene::Shape>& shapes = {}) {
  Worlds worlds = sized(view);
  set::Estimation estimation;
  estimation.caustics = caustics ? set::Caustics::traced : set::Caustics::none;
  render::Renderer renderer(shared_device(), estimation, view.calibration);
  renderer.set_scene(view.scene);
  renderer.set_environment(view.environment, set::LightSampling::importance);
  renderer.deform(shapes);
  for (std::uint32_t i = 0; i < scrambles; ++i) {
    render::FrameInput frame;
    frame.world_from_camera = view.world_from_camera;
    frame.seed = first_seed + i;
    renderer.begin(frame);
    renderer.render(samples);
    expect_clean(renderer.counters());
    const render::Layers layers = renderer.layers();
    worlds.mixed.pictures.push_back(widen(layers.mixed));
    worlds.real.pictures.push_back(widen(layers.real));
  }
  return worlds;
}

// The CPU tracer traces each world alone, with seeds of its own.
Worlds cpu_scrambles(const View& view, int samples, bool caustics) {
  Worlds worlds = sized(view);
  truth::TraceOptions options;
  options.caustics = caustics;
  truth::CpuTracer tracer(view.scene, view.environment, options);
  for (int i = 0; i < scrambles; ++i) {
    const auto seed = static_cast<std::uint64_t>(2 * i + 1);
    worlds.mixed.pictures.push_back(
        tracer.trace(view.calibration, view.world_from_camera, scene::world_mixed, samples, seed)
            .mean);
    worlds.real.pictures.push_back(
        tracer.trace(view.calibration, view.world_from_camera, scene::world_real, samples, seed + 1)
            .mean);
  }
  return worlds;
}

// Without caustics where mirrors or glass meet small lamps: so rare and bright are the paths that
// sixteen scrambles do not know their own spread.
// The GPU deforms the meshes to `shapes`; the CPU tracer is given them in those shapes.
void expect_agreement(const View& view, int samples, bool caustics,
                      const std::vector<scene::Shape>& shapes = {}) {
  const Worlds gpu = gpu_scrambles(view, samples, caustics, 1000, shapes);
  View still = view;
  still.scene = posed(view.scene, shapes);
  const Worlds cpu = cpu_scrambles(still, samples, caustics);
  const truth::Agreement mixed = truth::agreement(gpu.mixed, cpu.mixed);
  EXPECT_TRUE(mixed.agree) << "mixed: " << mixed.report();
  const truth::Agreement real = truth::agreement(gpu.real, cpu.real);
  EXPECT_TRUE(real.agree) << "real: " << real.report();
}

// The same picture by both estimators.
void expect_same_difference(const View& view, int samples, bool caustics,
                            const std::vector<scene::Shape>& shapes = {}) {
  const auto scrambled = [&](set::Estimator estimator, std::uint32_t first_seed) {
    set::Estimation estimation;
    estimation.estimator = estimator;
    if (!caustics) estimation.caustics = set::Caustics::none;
    render::Renderer renderer(shared_device(), estimation, view.calibration);
    renderer.set_scene(view.scene);
    renderer.set_environment(view.environment, set::LightSampling::importance);
    renderer.deform(shapes);
    truth::Scrambles result;
    result.width = view.calibration.intrinsics.width;
    result.height = view.calibration.intrinsics.height;
    for (std::uint32_t i = 0; i < scrambles; ++i) {
      renderer.begin({{}, 1.0, view.world_from_camera, first_seed + i});
      renderer.render(samples);
      expect_clean(renderer.counters());
      result.pictures.push_back(widen(renderer.layers().composite));
    }
    return result;
  };
  const truth::Agreement agreement = truth::agreement(scrambled(set::Estimator::paired, 1),
                                                      scrambled(set::Estimator::difference, 1001));
  EXPECT_TRUE(agreement.agree) << agreement.report();
}

class RandomSets : public ::testing::TestWithParam<std::uint32_t> {
 protected:
  static View view() {
    RandomScene options;
    options.width = 64;
    options.height = 48;
    options.lights = GetParam() % 2 == 0 ? 2 : 0;
    options.lens = GetParam() % 3 == 0;
    options.removed_objects = GetParam() % 2 == 1 ? 1 : 0;
    return random_scene(GetParam(), options);
  }
};

TEST_P(RandomSets, AgreeWithTheCpuTracer) {
  expect_agreement(view(), 32, true);
}

// Six consecutive seeds put each material on the first virtual object.
INSTANTIATE_TEST_SUITE_P(Seeds, RandomSets, ::testing::Range(1u, 7u));

// One world as the only one there is.
View alone(View view, std::uint32_t world) {
  std::erase_if(view.scene.instances,
                [world](const auto& instance) { return (instance.presence & world) == 0; });
  for (scene::Instance& instance : view.scene.instances) instance.presence = scene::world_both;
  for (set::Light& light : view.scene.lights) {
    if (world == scene::world_mixed) light.emission *= light.tint;
    light.tint = glm::dvec3(1);
    light.gain_mixed = light.gain_real =
        world == scene::world_mixed ? light.gain_mixed : light.gain_real;
  }
  return view;
}

// Both worlds from one run of paths, against two renders that know nothing of each other. Lamps
// that are added, taken away and dimmed, and a removed object.
class SeparateRenders : public RandomSets {};
INSTANTIATE_TEST_SUITE_P(Seeds, SeparateRenders, ::testing::Values(2u, 5u));

TEST_P(SeparateRenders, ShowWhatOneRunShows) {
  const Worlds pair = gpu_scrambles(view(), 32, true, 1000);
  const Worlds mixed = gpu_scrambles(alone(view(), scene::world_mixed), 32, true, 2000);
  const Worlds real = gpu_scrambles(alone(view(), scene::world_real), 32, true, 3000);
  const truth::Agreement in_mixed = truth::agreement(pair.mixed, mixed.mixed);
  EXPECT_TRUE(in_mixed.agree) << "mixed: " << in_mixed.report();
  const truth::Agreement in_real = truth::agreement(pair.real, real.real);
  EXPECT_TRUE(in_real.agree) << "real: " << in_real.report();
}

// Lamps that are real, dimmed or added, each in a colour of its own when mixed.
class TintedSets : public RandomSets {
 protected:
  static View view() {
    RandomScene options;
    options.width = 64;
    options.height = 48;
    options.lights = 3;
    options.tinted = true;
    return random_scene(GetParam(), options);
  }
};
INSTANTIATE_TEST_SUITE_P(Seeds, TintedSets, ::testing::Values(21u, 22u, 23u));

TEST_P(TintedSets, AgreeWithTheCpuTracer) {
  expect_agreement(view(), 16, true);
}

TEST_P(TintedSets, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(view(), 16, true);
}

// Patches of normals up to half a radian off.
scene::Texture bumps() {
  scene::Texture texture;
  texture.width = texture.height = 8;
  for (int i = 0; i < 64; ++i) {
    const double angle = 2.4 * i;
    const glm::dvec3 n =
        glm::normalize(glm::dvec3(0.5 * glm::dvec2(std::cos(angle), std::sin(angle)), 1));
    texture.texels.emplace_back(glm::vec3(0.5 * n + 0.5), 1.0f);
  }
  return texture;
}

scene::Texture holes() {
  scene::Texture texture;
  texture.width = texture.height = 4;
  texture.nearest = true;
  for (int i = 0; i < 16; ++i)
    texture.texels.emplace_back(glm::vec3(1), (i + i / 4) % 2 == 0 ? 1.0f : 0.0f);
  return texture;
}

// Returns a function that puts a mesh of a material somewhere into the scene.
auto adder_to(scene::Scene& scene) {
  return [&scene](scene::Mesh mesh, const scene::Material& material, const glm::dvec3& at,
                  std::uint32_t presence) {
    glm::dmat4 placed(1.0);
    placed[3] = glm::dvec4(at, 1);
    add_instance(scene, add_mesh(scene, std::move(mesh)), add_material(scene, material), placed,
                 presence);
  };
}

// Rough glass, solid and as a pane, white rough metal, normal maps on plastic and metal, a veil and
// a glowing fence with holes; on a table in both worlds, under an environment with a bright side.
View rough_materials() {
  View view;
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  scene::Material ball = glass(1.5f);
  ball.roughness = 0.4f;
  ball.base_color = {0.9f, 0.8f, 0.6f};
  scene::Material pane = ball;
  pane.thin_walled = true;
  pane.roughness = 0.25f;
  scene::Material bumpy = plastic({0.2f, 0.5f, 0.7f}, 0.3f);
  bumpy.normal_texture = add_texture(scene, bumps());
  scene::Material hammered = metal({0.9f, 0.7f, 0.4f}, 0.5f);
  hammered.normal_texture = bumpy.normal_texture;
  hammered.normal_scale = 0.7f;
  add(rectangle_mesh({3, 3}), diffuse({0.6f, 0.5f, 0.4f}), {0, 0, 0}, scene::world_both);
  add(box_mesh({0.3, 0.3, 0.3}), bumpy, {-0.5, 0.2, 0.15}, scene::world_both);
  add(uv_sphere_mesh(0.25, 48, 24), ball, {-0.1, -0.3, 0.25}, scene::world_mixed);
  add(uv_sphere_mesh(0.2, 48, 24), metal(glm::vec3(1), 0.8f), {0.4, 0.3, 0.2}, scene::world_mixed);
  add(box_mesh({0.25, 0.25, 0.25}), hammered, {0.5, -0.3, 0.125}, scene::world_real);
  add(box_mesh({0.6, 0.004, 0.5}), pane, {0.1, 0.6, 0.3}, scene::world_mixed);
  scene::Material veil = diffuse({0.8f, 0.3f, 0.3f});
  veil.alpha_mode = scene::AlphaMode::blend;
  veil.alpha = 0.4f;
  scene::Material fence = emitter({1.5f, 1.2f, 0.4f});
  fence.alpha_mode = scene::AlphaMode::mask;
  fence.base_color_texture = add_texture(scene, holes());
  add(box_mesh({0.4, 0.002, 0.3}), veil, {0.6, -0.7, 0.2}, scene::world_mixed);
  add(box_mesh({0.3, 0.002, 0.3}), fence, {-0.7, -0.4, 0.2}, scene::world_both);
  view.environment = uniform_environment(glm::vec3(0.3f, 0.4f, 0.5f), 8);
  for (int i = 0; i < 6; ++i) view.environment.radiance[static_cast<std::size_t>(9 + i)] *= 6.0f;
  view.calibration = pinhole(64, 48, 0.8);
  view.world_from_camera = look_at({0.6, -2, 1.2}, {0, 0, 0.15});
  return view;
}

// Panes of both worlds and of one: a clear and a stained one between lamps and the table, one with
// a matt share, one bent round a lamp, and a mirror and a solid ball that show them; lamps of every
// extent, one of them a mesh, in front of the panes and behind.
View panes() {
  View view;
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  const auto pane = [](const glm::vec3& tint) {
    scene::Material material = glass(1.5f);
    material.thin_walled = true;
    material.base_color = tint;
    return material;
  };
  scene::Material dusty = pane({0.9f, 0.8f, 0.7f});
  dusty.transmission = 0.6f;
  dusty.specular = 0;
  add(rectangle_mesh({3, 3}), diffuse({0.6f, 0.5f, 0.4f}), {0, 0, 0}, scene::world_both);
  add(rectangle_mesh({0.9, 0.9}), pane(glm::vec3(1)), {-0.5, 0, 0.5}, scene::world_both);
  add(rectangle_mesh({0.7, 0.7}), pane({0.9f, 0.5f, 0.1f}), {0.5, 0.1, 0.4}, scene::world_mixed);
  add(box_mesh({0.5, 0.05, 0.4}), dusty, {0, 0.6, 0.25}, scene::world_real);
  add(uv_sphere_mesh(0.15, 32, 16), pane({0.5f, 0.9f, 0.9f}), {0.1, -0.6, 0.3}, scene::world_mixed);
  add(uv_sphere_mesh(0.15, 32, 16), metal(glm::vec3(0.9f), 0.3f), {-0.5, -0.4, 0.15},
      scene::world_mixed);
  add(rectangle_mesh({0.3, 0.3}), emitter({4, 3, 2}), {-0.4, 0.3, 0.9}, scene::world_both);
  set::Light ball = lamp(set::LightType::sphere, glm::dvec3(8, 6, 4));
  ball.position = {0.1, -0.6, 0.3};
  ball.radius_m = 0.08;
  scene.lights.push_back(ball);
  set::Light panel = lamp(set::LightType::rectangle, glm::dvec3(3, 4, 5));
  panel.position = {0.6, 0.2, 1};
  panel.direction = {0, 0, -1};
  panel.width_m = panel.height_m = 0.4;
  panel.gain_mixed = 0.6;
  panel.tint = {1, 0.7, 0.5};
  scene.lights.push_back(panel);
  view.environment = uniform_environment(glm::vec3(0.3f, 0.4f, 0.5f), 8);
  for (int i = 0; i < 6; ++i) view.environment.radiance[static_cast<std::size_t>(9 + i)] *= 6.0f;
  view.calibration = pinhole(48, 32, 0.8);
  view.world_from_camera = look_at({0.6, -2, 1.2}, {0, 0, 0.15});
  return view;
}

TEST(Panes, AgreeWithTheCpuTracer) {
  expect_agreement(panes(), 16, true);
}

TEST(Panes, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(panes(), 16, true);
}

TEST(RoughMaterials, AgreeWithTheCpuTracer) {
  expect_agreement(rough_materials(), 32, true);
}

// A coloured ball with a matt cube and a glowing one inside, a rough coloured box, and a coloured
// block in both worlds that a lamp with a size stands in; lacquer on metal and, rough, on paint.
View glass_and_lacquer() {
  View view;
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  scene::Material jelly = glass(1.3f);
  jelly.attenuation_color = {0.8f, 0.2f, 0.3f};
  jelly.attenuation_distance_m = 0.2f;
  jelly.clearcoat = 0.8f;
  scene::Material frosted = glass(1.5f);
  frosted.roughness = 0.5f;
  frosted.attenuation_color = {0.2f, 0.6f, 0.9f};
  frosted.attenuation_distance_m = 0.15f;
  scene::Material block = glass(1.0f);
  block.attenuation_color = {0.3f, 0.9f, 0.2f};
  block.attenuation_distance_m = 0.3f;
  add(rectangle_mesh({3, 3}), diffuse({0.6f, 0.5f, 0.4f}), {0, 0, 0}, scene::world_both);
  add(uv_sphere_mesh(0.3, 48, 24), jelly, {-0.3, -0.2, 0.32}, scene::world_mixed);
  add(box_mesh({0.15, 0.15, 0.15}), diffuse({0.9f, 0.9f, 0.8f}), {-0.35, -0.2, 0.3},
      scene::world_mixed);
  add(box_mesh({0.08, 0.08, 0.08}), emitter({3, 3, 2}), {-0.2, -0.25, 0.42}, scene::world_mixed);
  add(box_mesh({0.3, 0.3, 0.4}), frosted, {0.35, -0.3, 0.22}, scene::world_mixed);
  add(box_mesh({0.4, 0.3, 0.5}), block, {0.1, 0.4, 0.27}, scene::world_both);
  scene::Material car = metal({0.6f, 0.1f, 0.1f}, 0.5f);
  car.clearcoat = 1;
  scene::Material toy = plastic({0.2f, 0.3f, 0.7f}, 0.6f);
  toy.clearcoat = 0.7f;
  toy.clearcoat_roughness = 0.3f;
  add(uv_sphere_mesh(0.2, 48, 24), car, {0.75, 0.1, 0.22}, scene::world_mixed);
  add(box_mesh({0.25, 0.25, 0.25}), toy, {-0.75, 0.2, 0.14}, scene::world_both);
  scene.lights.push_back(lamp(set::LightType::sphere, glm::dvec3(8, 7, 6)));
  scene.lights.back().position = {0.1, 0.4, 0.3};
  scene.lights.back().radius_m = 0.08;
  view.environment = uniform_environment(glm::vec3(0.3f, 0.4f, 0.5f), 8);
  view.calibration = pinhole(48, 32, 0.7);
  view.world_from_camera = look_at({0.4, -2, 1.1}, {0, 0, 0.2});
  return view;
}

TEST(GlassAndLacquer, AgreeWithTheCpuTracer) {
  expect_agreement(glass_and_lacquer(), 16, true);
}

TEST(GlassAndLacquer, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(glass_and_lacquer(), 16, true);
}

// Sheen above paint, a mirror, solid and rough glass, a pane and below lacquer; brushed metal and
// brushed plastic with bumps, also where no texture coordinates say which way; coloured gloss.
View cloth_and_brushed_metal() {
  View view;
  scene::Scene& scene = view.scene;
  const auto add = adder_to(scene);
  const auto under_sheen = [](scene::Material material, const glm::vec3& color, float roughness) {
    material.sheen_color = color;
    material.sheen_roughness = roughness;
    return material;
  };
  const auto brushed = [](scene::Material material, float strength, float rotation) {
    material.anisotropy = strength;
    material.anisotropy_rotation_rad = rotation;
    return material;
  };
  const glm::vec3 white(1);
  add(rectangle_mesh({3, 3}), under_sheen(diffuse({0.5f, 0.4f, 0.3f}), {0.3f, 0.5f, 0.9f}, 0.5f),
      {0, 0, 0}, scene::world_both);
  add(uv_sphere_mesh(0.2, 48, 24), brushed(metal({0.9f, 0.7f, 0.4f}, 0.3f), 0.7f, 0.5f),
      {-0.6, -0.2, 0.2}, scene::world_mixed);
  add(icosphere_mesh(0.15, 3), brushed(metal(white, 0.4f), 0.8f, 0), {-0.2, 0.5, 0.15},
      scene::world_both);
  scene::Material bumpy = brushed(plastic({0.2f, 0.5f, 0.7f}, 0.4f), 0.9f, -1);
  bumpy.normal_texture = add_texture(scene, bumps());
  add(box_mesh({0.3, 0.3, 0.3}), bumpy, {0.7, 0.3, 0.15}, scene::world_both);
  add(uv_sphere_mesh(0.2, 48, 24), under_sheen(metal(white, 0), {0.7f, 0.7f, 0.2f}, 0.3f),
      {0.3, -0.2, 0.2}, scene::world_mixed);
  add(uv_sphere_mesh(0.15, 48, 24), under_sheen(glass(1.4f), {0.9f, 0.5f, 0.5f}, 0.8f),
      {-0.1, -0.6, 0.15}, scene::world_mixed);
  scene::Material frosted = glass(1.5f);
  frosted.roughness = 0.5f;
  add(box_mesh({0.25, 0.25, 0.25}), under_sheen(frosted, white, 0.4f), {0.7, -0.4, 0.13},
      scene::world_mixed);
  scene::Material pane = glass(1.5f);
  pane.thin_walled = true;
  pane.base_color = {0.9f, 0.8f, 0.7f};
  add(box_mesh({0.5, 0.004, 0.4}), under_sheen(pane, {0.8f, 0.8f, 0.8f}, 0.6f), {0.3, 0.7, 0.2},
      scene::world_real);
  scene::Material seat = under_sheen(plastic({0.6f, 0.1f, 0.1f}, 0.5f), {0.9f, 0.9f, 0.6f}, 0.7f);
  seat.clearcoat = 0.6f;
  seat.clearcoat_roughness = 0.4f;
  add(box_mesh({0.3, 0.2, 0.2}), seat, {-0.8, 0.4, 0.1}, scene::world_both);
  scene::Material gloss = plastic({0.05f, 0.05f, 0.05f}, 0.3f, 2.0f);
  gloss.specular_color = {1.5f, 0.3f, 0.1f};
  add(uv_sphere_mesh(0.12, 48, 24), gloss, {0.2, 0.3, 0.12}, scene::world_mixed);
  scene.lights.push_back(lamp(set::LightType::sphere, glm::dvec3(6, 5, 4)));
  scene.lights.back().position = {-0.5, -0.8, 1.2};
  scene.lights.back().radius_m = 0.25;
  view.environment = uniform_environment(glm::vec3(0.3f, 0.4f, 0.5f), 8);
  for (int i = 0; i < 6; ++i) view.environment.radiance[static_cast<std::size_t>(9 + i)] *= 6.0f;
  view.calibration = pinhole(48, 32, 0.8);
  view.world_from_camera = look_at({0.4, -2, 1.0}, {0, 0, 0.15});
  return view;
}

TEST(ClothAndBrushedMetal, AgreeWithTheCpuTracer) {
  expect_agreement(cloth_and_brushed_metal(), 16, true);
}

TEST(ClothAndBrushedMetal, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(cloth_and_brushed_metal(), 16, true);
}

// A limb and a ball that change their shape, one in both worlds and one virtual, on a table.
View figures() {
  View view;
  scene::Scene& scene = view.scene;
  add_instance(scene, add_mesh(scene, rectangle_mesh({3, 3})),
               add_material(scene, diffuse({0.6f, 0.5f, 0.4f})));
  glm::dmat4 placed(1);
  placed[3] = {-0.4, 0.2, 0.05, 1};
  add_limb(scene, limb_mesh(24, 16, 5), 5, add_material(scene, diffuse({0.8f, 0.3f, 0.2f})), placed,
           scene::world_mixed);
  placed[3] = {0.5, -0.1, 0.32, 1};
  add_squeezed_ball(scene, squeezed_ball_mesh(0.3, 32, 16),
                    add_material(scene, metal({0.3f, 0.5f, 0.7f}, 0.4f)), placed);
  view.environment = uniform_environment(glm::vec3(0.3f, 0.4f, 0.5f), 8);
  for (int i = 0; i < 6; ++i) view.environment.radiance[static_cast<std::size_t>(9 + i)] *= 6.0f;
  view.calibration = pinhole(48, 32, 0.9);
  view.world_from_camera = look_at({0.3, -2, 1.1}, {0, 0, 0.3});
  return view;
}

std::vector<scene::Shape> shapes_of(const View& view) {
  return {bent_limb(view.scene.deformations[0], 0.3), {{0.9}, {}}};
}

TEST(DeformedFigures, AgreeWithTheCpuTracer) {
  const View view = figures();
  expect_agreement(view, 16, true, shapes_of(view));
}

TEST(DeformedFigures, HaveTheSameDifferenceByBothEstimators) {
  const View view = figures();
  expect_same_difference(view, 16, true, shapes_of(view));
}

// The difference estimator against the paired one: by the difference where nothing covers the
// picture, and by the composite over black everywhere. Lamps differ between the worlds in every
// other set, objects are taken away in the rest.
TEST_P(RandomSets, HaveTheSameDifferenceByBothEstimators) {
  expect_same_difference(view(), 16, true);
}

// Real radiance from a plate that is the renderer's own converged real world, against tracing it.
// The plate's pixels are box means between which the camera's radiance is interpolated, so matt
// real surfaces without textures are looked at.
class CameraSets : public RandomSets {};
INSTANTIATE_TEST_SUITE_P(Seeds, CameraSets, ::testing::Values(2u, 3u));  // lamps; a lens, a removed

TEST_P(CameraSets, HaveTheSameCompositeByTheCamera) {
  View view = RandomSets::view();
  view.calibration.response.kind = ResponseCurve::Kind::linear;
  for (scene::Instance& instance : view.scene.instances)
    if ((instance.presence & scene::world_real) != 0) instance.material = 0;
  view.scene.materials[0] = diffuse(glm::vec3(0.5f, 0.4f, 0.3f));
  constexpr double white = 8;
  const auto renderer_by = [&](set::RealRadiance radiance) {
    set::Estimation estimation;
    estimation.real_radiance = radiance;
    auto renderer =
        std::make_unique<render::Renderer>(shared_device(), estimation, view.calibration);
    renderer->set_scene(view.scene);
    renderer->set_environment(view.environment, set::LightSampling::importance);
    return renderer;
  };
  Plate plate;
  plate.width = view.calibration.intrinsics.width;
  plate.height = view.calibration.intrinsics.height;
  plate.bits = 16;
  const auto converged = renderer_by(set::RealRadiance::traced);
  converged->begin({{}, 1.0, view.world_from_camera, 7});
  converged->render(1024);
  for (const glm::vec3& pixel : converged->layers().real)
    for (int c = 0; c < 3; ++c)
      plate.samples.push_back(
          static_cast<std::uint16_t>(std::lround(65535 * std::min(pixel[c] / white, 1.0))));
  const auto scrambled = [&](set::RealRadiance radiance, std::uint32_t first_seed) {
    const auto renderer = renderer_by(radiance);
    truth::Scrambles result{plate.width, plate.height, {}};
    for (std::uint32_t i = 0; i < scrambles; ++i) {
      renderer->begin({std::make_shared<const Plate>(plate), 1 / white, view.world_from_camera,
                       first_seed + i});
      renderer->render(16);
      expect_clean(renderer->counters());
      result.pictures.push_back(widen(renderer->layers().composite));
    }
    return result;
  };
  const truth::Agreement agreement = truth::agreement(scrambled(set::RealRadiance::traced, 100),
                                                      scrambled(set::RealRadiance::camera, 1001));
  EXPECT_TRUE(agreement.agree) << agreement.report();
}

// The committed glass set, or one of the others.
std::filesystem::path truth_directory(const std::string& name) {
  if (name == "glass") return PREVIZ_SOURCE_DIR "/tests/truth/data/glass";
  return shared_data("groundtruth") / name;
}

View truth_view(const std::filesystem::path& directory) {
  const truth::TruthSet truth_set = truth::load_truth_set(directory);
  set::Set set;
  set.objects.resize(2);
  set.objects[0].name = "phantom";
  set.objects[0].file = truth_set.phantom;
  set.objects[0].presence = set::Presence::phantom;
  set.objects[1].name = "virtual";
  set.objects[1].file = truth_set.virtual_objects;
  set.lighting.environment = truth_set.environment;
  set.lighting.resolution = 256;
  View view;
  view.scene = scene::load_scene(set);
  view.environment = lighting::load_environment(set.lighting).environment;
  view.calibration = truth::resized(truth_set.observer, 0.1);
  view.world_from_camera =
      observer_frame(truth_set, truth_set.truth_frames.front()).world_from_camera;
  return view;
}

class TruthScenes : public ::testing::TestWithParam<std::string> {};

TEST_P(TruthScenes, AgreeWithTheCpuTracer) {
  const auto directory = truth_directory(GetParam());
  PREVIZ_NEEDS(directory / "set.json");
  expect_agreement(truth_view(directory), 32, false);
}

TEST_P(TruthScenes, HaveTheSameDifferenceByBothEstimators) {
  const auto directory = truth_directory(GetParam());
  PREVIZ_NEEDS(directory / "set.json");
  expect_same_difference(truth_view(directory), 32, false);
}

INSTANTIATE_TEST_SUITE_P(Sets, TruthScenes, ::testing::Values("glass", "desk", "statues"),
                         [](const auto& set) { return set.param; });

}  // namespace renderer_agreement_test
}  // namespace previz::test
