// A live frame's cost on a graphics card beside its passes is bounded: how often work is handed
// over and waited for, what is allocated, and what is copied. A CPU device stands in for the card.
#include "daemon/core/render/device/device.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::live_budget_test {

// A glass ball above a floor, so that there are photons.
View ball_above_floor(int width, int height) {
  View view = empty_view({0, -0.8, 1}, {0, 0, 0.05}, pinhole(width, height, 0.8), glm::vec3(0.1f));
  add(view.scene, rectangle_mesh({2, 2}), diffuse(glm::vec3(0.5f)));
  add(view.scene, icosphere_mesh(0.2, 1), glass(1.5f), at({0, 0, 0.25}), scene::world_mixed);
  view.scene.lights.push_back(sphere_lamp({0.3, 0, 1}, 0.1, glm::dvec3(2)));
  return view;
}

Frame mosaic(int width, int height) {
  Frame frame;
  frame.format = PixelFormat::gray8;
  frame.bayer = BayerPattern::rggb;
  frame.width = width;
  frame.height = height;
  const Plate plate = random_plate(width, height, 8);
  frame.bytes.assign(plate.samples.begin(), plate.samples.begin() + width * height);
  return frame;
}

class LiveBudget : public ::testing::Test {
 protected:
  LiveBudget(int width = 960, int height = 540, bool validation = false)
      : pixels_(std::uint64_t{1} * width * height),
        device_(render::open_device({.validation = validation, .name = "", .as_gpu = true})),
        renderer_(ball_above_floor(width, height), {.max_depth = 1}, set::LightSampling::importance,
                  device_),
        camera_(std::make_shared<const Frame>(mosaic(width, height))) {}

  // A frame that is averaged with those before, denoised and shown. Returns what it cost.
  render::DeviceWork frame(int samples, const render::ShowTo& to) {
    const render::DeviceWork before = render::work_of(*device_);
    ++frames_;
    renderer_.begin({.exposure = 0.5,
                     .world_from_camera = look_at({0.004 * frames_, -0.8, 1}, {0, 0, 0.05}),
                     .accumulates = true,
                     .camera = camera_});
    renderer_.render(samples);
    expect_clean(renderer_.show_later(true, to).finish().counters);
    const render::DeviceWork after = render::work_of(*device_);
    return {.submissions = after.submissions - before.submissions,
            .waits = after.waits - before.waits,
            .allocations = after.allocations - before.allocations,
            .bytes_up = after.bytes_up - before.bytes_up,
            .bytes_down = after.bytes_down - before.bytes_down};
  }

  static constexpr render::ShowTo shown{.computer = false, .card = true};
  static constexpr render::ShowTo shown_and_recorded{.computer = true, .card = true};

  void expect_within_budget(const render::DeviceWork& work, std::uint64_t picture_bytes) {
    EXPECT_LE(work.submissions, 2u);
    EXPECT_LE(work.waits, 1u) << "for the picture";
    EXPECT_EQ(work.allocations, 0u);
    // The camera's own bytes go up, a mosaic's. What else a frame needs, lamps, instances and
    // constants, is small, and so is what it counts.
    constexpr std::uint64_t small = 1u << 16;
    EXPECT_LE(work.bytes_up, camera_->bytes.size() + small);
    EXPECT_LE(work.bytes_down, picture_bytes + (1u << 10));
  }

  const std::uint64_t pixels_;
  std::shared_ptr<render::Device> device_;
  SetRenderer renderer_;
  FramePtr camera_;
  int frames_ = 0;
};

TEST_F(LiveBudget, OfAFrameIsTwoSubmissionsAndOneWait) {
  // Both sides of what is averaged are made in the first two frames. A card is given more at once
  // once it has shown how fast it is.
  for (int i = 0; i < 2; ++i) frame(1, shown_and_recorded);
  for (int i = 0; i < 8 && !device_->is_cpu(); ++i) frame(4, shown);
  {
    SCOPED_TRACE("one sample, shown");
    expect_within_budget(frame(1, shown), 0);
  }
  SCOPED_TRACE("four samples, shown and recorded with 16 bits a channel");
  expect_within_budget(frame(4, shown_and_recorded), 6 * pixels_);
}

// No dispatch, buffer or picture is larger than devices allow: Vulkan's validation knows how much
// this one does. How many submissions such a frame takes depends on how fast the device is.
class LiveBudgetOf4K : public LiveBudget {
 protected:
  LiveBudgetOf4K() : LiveBudget(3840, 2160, true) {}
};

TEST_F(LiveBudgetOf4K, IsThatOfItsPixels) {
  frame(1, shown);
  const render::DeviceWork work = frame(1, shown);
  EXPECT_LE(work.bytes_up, camera_->bytes.size() + (1u << 16));
  EXPECT_LE(work.bytes_down, 1u << 10);
  EXPECT_EQ(render::validation_messages(*device_), 0u);
}

}  // namespace previz::test::live_budget_test
