// A CPU device that is treated as a graphics card: its pictures are those of a CPU device bit for
// bit, and no access to memory lacks the barrier that a card would need.
#include "daemon/core/render/device/device.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::as_gpu_test {

constexpr int width = 48, height = 36;

// A textured floor, and above it a glass ball that only the mixed world has, under a lamp of both.
View ball_on_texture() {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0.05}, pinhole(width, height, 0.8), glm::vec3(0.1f));
  scene::Material floor = diffuse(glm::vec3(0.7f));
  const glm::vec4 red(0.9f, 0.2f, 0.2f, 1), green(0.2f, 0.9f, 0.2f, 1);
  const glm::vec4 blue(0.2f, 0.2f, 0.9f, 1), white(0.9f, 0.9f, 0.9f, 1);
  floor.base_color_texture = add_texture(view.scene, texture_of(2, 2, {red, green, blue, white}));
  add(view.scene, rectangle_mesh({2, 2}), floor);
  add(view.scene, icosphere_mesh(0.2, 2), glass(1.5f), at({0, 0, 0.25}), scene::world_mixed);
  view.scene.lights.push_back(sphere_lamp({0.3, 0, 1}, 0.1, glm::dvec3(2)));
  return view;
}

set::Estimation many_photons() {
  return {.photons = 4};
}

struct Pictures {
  std::vector<Plate> live;
  render::Layers offline;
};

// Begins a live frame that is averaged with those before it, and gives it its samples.
void render_live(render::Renderer& renderer, const PlatePtr& plate, int frame) {
  renderer.begin({.plate = plate,
                  .exposure = 0.5,
                  .world_from_camera = look_at({0.004 * frame, -0.8, 1}, {0, 0, 0.05}),
                  .accumulates = true});
  renderer.render(2);
}

// Renders live frames that are averaged and denoised, through a camera that moves a little.
std::vector<Plate> live_frames(render::Renderer& renderer, int count) {
  std::vector<Plate> shown;
  const auto plate = std::make_shared<const Plate>(random_plate(width, height, 8));
  for (int frame = 0; frame < count; ++frame) {
    render_live(renderer, plate, frame);
    expect_clean(renderer.counters());
    shown.push_back(renderer.show(true));
  }
  return shown;
}

// The same frames, each begun before the picture of the last one is there.
std::vector<Plate> overlapping_frames(render::Renderer& renderer, int count) {
  std::vector<Plate> shown;
  std::optional<render::Showing> last;
  const auto plate = std::make_shared<const Plate>(random_plate(width, height, 8));
  const auto finish = [&] {
    if (!last) return;
    render::Showing::Shown there = last->finish();
    expect_clean(there.counters);
    EXPECT_GT(there.counters.rays, 0u);
    shown.push_back(*there.picture);
  };
  for (int frame = 0; frame < count; ++frame) {
    render_live(renderer, plate, frame);
    render::Showing showing = renderer.show_later(true);
    finish();
    last = std::move(showing);
  }
  finish();
  return shown;
}

Pictures pictures_on(const std::shared_ptr<render::Device>& device) {
  const View view = ball_on_texture();
  SetRenderer renderer(view, many_photons(), set::LightSampling::importance, device);
  Pictures result{live_frames(renderer, 3), {}};
  result.offline = renderer.rendered(8);
  EXPECT_EQ(render::validation_messages(*device), 0u);
  return result;
}

void expect_the_pictures_of_a_cpu(const std::shared_ptr<render::Device>& as_gpu) {
  // On a card there is no other path to compare with; every other test then runs the card's.
  if (!as_gpu->is_cpu()) GTEST_SKIP() << "the device is a graphics card";
  if (!shared_device()->shares_host_memory()) GTEST_SKIP() << "PREVIZ_AS_GPU is set";
  EXPECT_FALSE(as_gpu->shares_host_memory());
  EXPECT_TRUE(shared_device()->shares_host_memory());
  EXPECT_FALSE(render::is_gpu(*as_gpu));
  const Pictures expected = pictures_on(shared_device()), found = pictures_on(as_gpu);
  ASSERT_EQ(found.live.size(), expected.live.size());
  for (std::size_t i = 0; i < found.live.size(); ++i)
    EXPECT_TRUE(found.live[i].samples == expected.live[i].samples) << "frame " << i;
  EXPECT_NE(found.live[0].samples, random_plate(width, height, 8).samples);
  EXPECT_TRUE(found.offline.composite == expected.offline.composite);
  EXPECT_TRUE(found.offline.diff == expected.offline.diff);
  EXPECT_TRUE(found.offline.variance == expected.offline.variance);
  EXPECT_TRUE(found.offline.depth == expected.offline.depth);
  EXPECT_GT(render::work_of(*as_gpu).submissions, 0u);
}

// A mirror that shows what the camera has seen, below a tinted pane, both in the mixed world alone,
// and more lamps than are chosen without a tree: what a card does in passes of its own.
View mirror_below_a_pane() {
  View view = empty_view({0, -1.5, 1}, {0, 0.2, 0.2}, pinhole(width, height, 0.9), glm::vec3(0.1f));
  add(view.scene, rectangle_mesh({4, 4}), diffuse(glm::vec3(0.5f)));
  const glm::dmat4 leaning = glm::rotate(at({0, 0.5, 0.4}), 1.9, glm::dvec3(1, 0, 0));
  add(view.scene, rectangle_mesh({0.5, 0.4}), metal(glm::vec3(1), 0), leaning, scene::world_mixed);
  add(view.scene, rectangle_mesh({0.4, 0.6}), pane({0.9f, 0.6f, 0.2f}), at({0.3, 0, 0.5}),
      scene::world_mixed);
  for (int i = 0; i < 8; ++i)
    view.scene.lights.push_back(
        sphere_lamp({0.4 * i - 1.4, 0.3 * (i % 3), 1.5}, 0.05, glm::dvec3(1 + i % 2)));
  return view;
}

struct Counted {
  render::Layers layers;
  render::Counters counters;
};

Counted by_camera_on(const std::shared_ptr<render::Device>& device) {
  SetRenderer renderer(mirror_below_a_pane(), {.real_radiance = set::RealRadiance::camera},
                       set::LightSampling::importance, device);
  renderer.begin({.plate = std::make_shared<const Plate>(random_plate(width, height, 8)),
                  .exposure = 0.5,
                  .world_from_camera = mirror_below_a_pane().world_from_camera});
  renderer.render(8);
  return {renderer.layers(), renderer.counters()};
}

// Every path is counted once, and where it goes does not depend on how the work is shared out.
TEST(AsGpu, ShadesInPartsAsACpuDoesAtOnce) {
  const auto as_gpu = render::open_device({.validation = true, .name = "", .as_gpu = true});
  if (!as_gpu->is_cpu()) GTEST_SKIP() << "the device is a graphics card";
  if (!shared_device()->shares_host_memory()) GTEST_SKIP() << "PREVIZ_AS_GPU is set";
  const Counted expected = by_camera_on(shared_device()), found = by_camera_on(as_gpu);
  EXPECT_GT(found.counters.measured, 0u);
  EXPECT_EQ(found.counters.measured, expected.counters.measured);
  EXPECT_EQ(found.counters.unmeasured, expected.counters.unmeasured);
  EXPECT_EQ(found.counters.rays, expected.counters.rays);
  EXPECT_EQ(found.counters.shadow_rays, expected.counters.shadow_rays);
  EXPECT_EQ(found.counters.stopped_in_layers, expected.counters.stopped_in_layers);
  EXPECT_TRUE(found.layers.mixed == expected.layers.mixed);
  EXPECT_TRUE(found.layers.diff == expected.layers.diff);
  EXPECT_TRUE(found.layers.variance == expected.layers.variance);
  EXPECT_EQ(render::validation_messages(*as_gpu), 0u);
}

TEST(AsGpu, HasThePicturesOfACpuBitForBit) {
  expect_the_pictures_of_a_cpu(
      render::open_device({.validation = true, .name = "", .as_gpu = true}));
}

TEST(AsGpu, HasThePicturesOfACpuBitForBitWhereItsMemoryIsMapped) {
  expect_the_pictures_of_a_cpu(
      render::open_device({.validation = true, .name = "", .as_gpu = true, .as_integrated = true}));
}

std::shared_ptr<render::Device> hazards_heard(bool as_integrated = false) {
  return render::open_device({.validation = true,
                              .name = "",
                              .as_gpu = true,
                              .as_integrated = as_integrated,
                              .synchronization = true});
}

void expect_the_same_where_frames_overlap(const std::shared_ptr<render::Device>& as_gpu) {
  const View view = ball_on_texture();
  SetRenderer one(view, many_photons(), set::LightSampling::importance, as_gpu);
  SetRenderer other(view, many_photons(), set::LightSampling::importance, as_gpu);
  const std::vector<Plate> alone = live_frames(one, 4), overlapping = overlapping_frames(other, 4);
  ASSERT_EQ(overlapping.size(), alone.size());
  for (std::size_t i = 0; i < alone.size(); ++i)
    EXPECT_TRUE(overlapping[i].samples == alone[i].samples) << "frame " << i;
  EXPECT_EQ(render::validation_messages(*as_gpu), 0u);
}

TEST(AsGpu, HasTheSamePicturesWhereFramesOverlap) {
  expect_the_same_where_frames_overlap(hazards_heard());
}

TEST(AsGpu, HasTheSamePicturesWhereFramesOverlapInMappedMemory) {
  expect_the_same_where_frames_overlap(hazards_heard(/*as_integrated=*/true));
}

void two_live_frames(const std::shared_ptr<render::Device>& device) {
  SetRenderer renderer(ball_on_texture(), many_photons(), set::LightSampling::importance, device);
  live_frames(renderer, 2);
}

TEST(AsGpu, NoAccessLacksItsBarrier) {
  for (const bool as_integrated : {false, true}) {
    const auto device = hazards_heard(as_integrated);
    two_live_frames(device);
    EXPECT_EQ(render::validation_messages(*device), 0u) << as_integrated;
  }
}

VKAPI_ATTR void VKAPI_CALL no_barrier(VkCommandBuffer, const VkDependencyInfo*) {}

// The check above is worth something only if it hears a barrier that is missing. Here all are: the
// device's table of functions, which is the test's own, gets a barrier that does nothing.
TEST(AsGpu, AMissingBarrierIsHeard) {
  const auto device = hazards_heard();
  // A card would run without barriers what needs them: its queues then lose paths.
  if (!device->is_cpu()) GTEST_SKIP() << "the device is a graphics card";
  using Table = std::remove_cvref_t<decltype(*device->vk().getDispatcher())>;
  const_cast<Table*>(device->vk().getDispatcher())->vkCmdPipelineBarrier2 = no_barrier;
  two_live_frames(device);
  EXPECT_GT(render::validation_messages(*device), 0u);
}

}  // namespace previz::test::as_gpu_test
