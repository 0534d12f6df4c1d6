// Rays that the device's own units trace: pictures are those of our trees, but for rounding.
#include "daemon/core/render/device/device.hpp"
#include "tests/support/figure.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::hardware_rays_test {

constexpr int width = 48, height = 36;

// A virtual sheet that lies on the floor, a glass ball that only one world has, a real box that is
// removed.
View room() {
  View view = empty_view({0, -1.6, 0.6}, {0, 0, 0.1}, pinhole(width, height, 0.8), glm::vec3(0.2f));
  add(view.scene, rectangle_mesh({3, 3}), diffuse(glm::vec3(0.7f)));
  add(view.scene, rectangle_mesh({0.5, 0.5}), diffuse(glm::vec3(0.1f, 0.2f, 0.8f)),
      at({-0.4, 0, 0}), scene::world_mixed);
  add(view.scene, icosphere_mesh(0.15, 3), glass(1.5f), at({0, -0.3, 0.2}), scene::world_mixed);
  add(view.scene, box_mesh({0.2, 0.2, 0.3}), diffuse(glm::vec3(0.6f)), at({0.5, 0.4, 0.15}),
      scene::world_real);
  view.scene.lights = {sphere_lamp({0.3, 0, 1.5}, 0.2, glm::dvec3(8))};
  return view;
}

// The same with surfaces that some rays meet and others do not.
View room_with_open_surfaces() {
  View view = room();
  scene::Material veil = diffuse(glm::vec3(0.9f, 0.3f, 0.1f));
  veil.alpha = 0.5f;
  veil.alpha_mode = scene::AlphaMode::blend;
  add(view.scene, rectangle_mesh({0.4, 0.4}), veil, at({0.1, 0.1, 0.5}), scene::world_mixed);
  add(view.scene, rectangle_mesh({0.4, 0.4}), pane(glm::dvec3(0.9, 0.6, 0.4)), at({0.5, 0, 0.4}),
      scene::world_mixed);
  return view;
}

class HardwareRays : public testing::Test {
 protected:
  void SetUp() override {
    render::DeviceOptions options{.validation = true, .name = ""};
    options.hardware_rays = false;
    trees_ = render::open_device(options);
    options.hardware_rays = true;
    hardware_ = render::open_device(options);
    if (!hardware_->traces_in_hardware())
      GTEST_SKIP() << hardware_->name() << " has no VK_KHR_ray_query";
  }
  void TearDown() override {
    EXPECT_EQ(render::validation_messages(*trees_), 0u);
    EXPECT_EQ(render::validation_messages(*hardware_), 0u);
  }
  std::shared_ptr<render::Device> trees_, hardware_;
};

// The random numbers of a path are the same. It goes another way only where rounding decides what
// it meets, at the edges of triangles, which few do.
void expect_same(std::span<const glm::vec3> found, std::span<const glm::vec3> expected) {
  ASSERT_EQ(found.size(), expected.size());
  const glm::dvec3 average = mean(expected);
  std::size_t other = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    other +=
        glm::length(glm::dvec3(found[i]) - glm::dvec3(expected[i])) > 1e-3 * glm::length(average);
  EXPECT_LE(other, found.size() / 50);
  expect_near(mean(found), average, 0.01 * average);
}

TEST_F(HardwareRays, ShowWhatOurTreesShow) {
  const View view = room();
  for (const set::Estimator estimator : {set::Estimator::paired, set::Estimator::difference}) {
    const set::Estimation estimation{.estimator = estimator, .photons = 4};
    SetRenderer trees(view, estimation, set::LightSampling::importance, trees_);
    SetRenderer hardware(view, estimation, set::LightSampling::importance, hardware_);
    const render::Layers expected = trees.rendered_clean(4), found = hardware.rendered_clean(4);
    expect_same(found.mixed, expected.mixed);
    expect_same(found.real, expected.real);
    EXPECT_GT(glm::length(mean(expected.mixed) - mean(expected.real)), 1e-3);
  }
}

// Whether a ray meets a veil is decided by a hash of its bits, which rounding changes: the paths
// part, and the picture is the same but for its noise. With 16 samples of 1,728 pixels that is half
// a percent.
TEST_F(HardwareRays, LetTheSameLightThrough) {
  const View view = room_with_open_surfaces();
  SetRenderer trees(view, {}, set::LightSampling::importance, trees_);
  SetRenderer hardware(view, {}, set::LightSampling::importance, hardware_);
  const render::Layers expected = trees.rendered_clean(16), found = hardware.rendered_clean(16);
  expect_near(mean(found.mixed), mean(expected.mixed), 0.02 * mean(expected.mixed));
  expect_same(found.real, expected.real);
}

// The structures follow what moves, changes its shape, leaves a world and comes back.
TEST_F(HardwareRays, FollowWhatMoves) {
  View view = empty_view({0, -1.9, 0.6}, {0, 0, 0.4}, pinhole(width, height, 0.9), glm::vec3(0.5f));
  add(view.scene, rectangle_mesh({3, 3}), diffuse(glm::vec3(0.7f)));
  add_limb(view.scene, limb_mesh(12, 12, 4), 4,
           add_material(view.scene, diffuse(glm::vec3(0.8f, 0.2f, 0.1f))), at({-0.3, 0, 0}),
           scene::world_mixed);
  add(view.scene, box_mesh({0.3, 0.3, 0.3}), diffuse(glm::vec3(0.2f, 0.7f, 0.3f)),
      at({0.4, 0, 0.15}), scene::world_mixed);
  SetRenderer trees(view, {}, set::LightSampling::importance, trees_);
  SetRenderer hardware(view, {}, set::LightSampling::importance, hardware_);
  std::vector<scene::Instance> instances = view.scene.instances;
  glm::dvec3 last(0);
  for (int step = 0; step < 4; ++step) {
    instances[2].world_from_object = at({0.4, 0.2 * step, 0.15 + 0.1 * step});
    instances[2].presence = step == 2 ? 0u : scene::world_mixed;
    for (SetRenderer* renderer : {&trees, &hardware}) {
      renderer->move(instances, {});
      renderer->deform({bent_limb(view.scene.deformations[0], 0.2 * step)});
    }
    const render::Layers expected = trees.rendered_clean(2), found = hardware.rendered_clean(2);
    expect_same(found.mixed, expected.mixed);
    EXPECT_NE(mean(expected.mixed), last);
    last = mean(expected.mixed);
  }
}

// A mesh without a triangle, one whose triangles are all dropped, and a place that is none.
TEST_F(HardwareRays, MeetNothingWhereThereIsNothing) {
  View view = empty_view({0, 0, 1}, {0, 0, 0}, pinhole(16, 16, 0.8), glm::vec3(0.25f));
  add(view.scene, scene::Mesh{}, diffuse(glm::vec3(1)));
  scene::Mesh broken = rectangle_mesh({1, 1});
  for (glm::vec3& position : broken.positions) position.x = std::nanf("");
  add(view.scene, broken, diffuse(glm::vec3(1)));
  // Of this one a triangle is left, behind the camera.
  scene::Mesh torn = rectangle_mesh({1, 1});
  torn.positions.insert(torn.positions.end(), {{0, std::nanf(""), 0}, {1e30f, 0, 0}, {0, 1, 2}});
  torn.normals.resize(torn.positions.size(), glm::vec3(0, 0, 1));
  if (!torn.uvs.empty()) torn.uvs.resize(torn.positions.size());
  torn.triangles = {{4, 0, 1}, {5, 0, 1}, {0, 1, 6}};
  for (int i = 0; i < 4; ++i) torn.positions[static_cast<std::size_t>(i)].z = 2;
  add(view.scene, torn, diffuse(glm::vec3(1)));
  add(view.scene, rectangle_mesh({1, 1}), diffuse(glm::vec3(1)), glm::dmat4(0.0));
  SetRenderer hardware(view, {}, set::LightSampling::importance, hardware_);
  EXPECT_EQ(mean(hardware.rendered_clean(1).mixed), glm::dvec3(0.25));
}

TEST_F(HardwareRays, CanBeRefused) {
  EXPECT_FALSE(trees_->traces_in_hardware());
}

// A set can refuse them, and the command line says more than a set. Nobody asks a CPU device for
// them by a set.
TEST(DeviceOptions, TakeFromASetThatItRefusesHardwareRays) {
  EXPECT_EQ(render::options_for({}, true).hardware_rays, std::nullopt);
  EXPECT_EQ(render::options_for({}, false).hardware_rays, false);
  for (const bool asked : {false, true}) {
    render::DeviceOptions options;
    options.hardware_rays = asked;
    EXPECT_EQ(render::options_for(options, !asked).hardware_rays, asked);
  }
}

}  // namespace previz::test::hardware_rays_test
