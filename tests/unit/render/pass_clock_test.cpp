// The device's own clock: what it times is what ran, and it is silent where nobody asked.
#include "daemon/core/render/device/device.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::pass_clock_test {

constexpr int width = 32, height = 24, bounces = 2;

View floor_under_sky() {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0}, pinhole(width, height, 0.8), glm::vec3(0.2f));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.5f)));
  return view;
}

render::DeviceTimes times_of_a_frame(bool times_passes) {
  render::DeviceOptions options;
  options.validation = true;
  options.times_passes = times_passes;
  const auto device = render::open_device(options);
  const View view = floor_under_sky();
  SetRenderer renderer(view, up_to_depth(bounces), set::LightSampling::importance, device);
  render::take_times(*device);
  const std::uint64_t before = render::work_of(*device).submissions;
  renderer.begin({.plate = nullptr, .world_from_camera = view.world_from_camera});
  renderer.render(1);
  renderer.layers();
  render::DeviceTimes times = render::take_times(*device);
  EXPECT_EQ(times.submissions, times_passes ? render::work_of(*device).submissions - before : 0);
  EXPECT_TRUE(render::take_times(*device).passes.empty()) << "it was taken";
  EXPECT_EQ(render::validation_messages(*device), 0u);
  return times;
}

TEST(PassClock, TimesEveryPassOfAFrame) {
  const render::DeviceTimes times = times_of_a_frame(true);
  EXPECT_EQ(times.untimed, 0u);
  double passes_ms = 0;
  for (const auto& pass : times.passes) {
    EXPECT_GT(pass.count, 0u) << pass.name;
    EXPECT_GE(pass.ms, 0) << pass.name;
    passes_ms += pass.ms;
  }
  const auto count_of = [&](const char* name) {
    const auto found = std::ranges::find(times.passes, name, &render::DeviceTimes::Pass::name);
    return found == times.passes.end() ? 0 : found->count;
  };
  EXPECT_EQ(count_of("generate"), 1u);
  EXPECT_EQ(count_of("accumulate"), 1u);
  EXPECT_GE(count_of("shade") + count_of("shade_light"), 1u);  // on a card
  EXPECT_GT(passes_ms, 0);
  // The computer waits at least as long as the device works, by clocks whose crystals are off by
  // less than 500 parts in a million each.
  EXPECT_LE(passes_ms, 1.001 * times.waited_ms);
}

VKAPI_ATTR void VKAPI_CALL no_timestamp(VkCommandBuffer, VkPipelineStageFlags2, VkQueryPool,
                                        std::uint32_t) {}

// A driver that never has the times must not be waited for. Here the device's table of functions,
// which is the test's own, gets a timestamp that writes nothing.
TEST(PassClock, CountsWhatTheDriverDoesNotTime) {
  render::DeviceOptions options;
  options.times_passes = true;
  const auto device = render::open_device(options);
  using Table = std::remove_cvref_t<decltype(*device->vk().getDispatcher())>;
  const_cast<Table*>(device->vk().getDispatcher())->vkCmdWriteTimestamp2 = no_timestamp;
  SetRenderer renderer(floor_under_sky(), up_to_depth(bounces), set::LightSampling::importance,
                       device);
  EXPECT_GT(mean(renderer.rendered(1).mixed).g, 0);
  const render::DeviceTimes times = render::take_times(*device);
  EXPECT_GT(times.untimed, 0u);
  EXPECT_TRUE(times.passes.empty());
  EXPECT_GT(times.submissions, 0u);
}

TEST(PassClock, TimesNothingUnlessItIsAsked) {
  if (render::is_gpu(*shared_device())) GTEST_SKIP() << "a graphics card's passes are always timed";
  const render::DeviceTimes times = times_of_a_frame(false);
  EXPECT_TRUE(times.passes.empty());
  EXPECT_EQ(times.waited_ms, 0);
}

}  // namespace previz::test::pass_clock_test
