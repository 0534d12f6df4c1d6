// On a graphics card the next frame is begun before the picture of the last one is there. What is
// shown, refined and saved is what it was.
#include "shaders/lib/render_shared.h"
#include "tests/support/live_rig.hpp"
#include "tests/support/other_camera.hpp"

namespace previz::rig::overlap_test {

using namespace nlohmann::literals;

class RigAsAGraphicsCard : public test::RigLive {
 protected:
  void SetUp() override {
    write_set("", 1'000'000);  // a camera that is faster than any card
    options_.device.as_gpu = true;
    options_.device.times_passes = true;
    while_shown_ = [this] {
      const Shown shown = shown_now();
      if (shown.shot.frozen) return;
      const std::int64_t time = shown.shot.frame->timestamp_ns;
      EXPECT_GT(time, last_ns_) << "picture " << shown.count;
      last_ns_ = time;
    };
  }

  // A screen that is larger than the pictures, and has nothing above them.
  void write_display() {
    replace_in_set("[recording]\n",
                   "[display]\ndriver = \"headless\"\nmode = \"480x270\"\nscale = \"1:1\"\n"
                   "osd = false\n[recording]\n");
  }

  std::int64_t last_ns_ = 0;
};

TEST_F(RigAsAGraphicsCard, ShowsEveryPictureInItsOrderAndRefines) {
  run_rendering([&] {
    until_rendered(6);
    press("refine");
    until_frozen(8);
    press("snapshot");
    until_mode(live::Mode::live);
    until_rendered(3);
  });
  EXPECT_TRUE(std::filesystem::exists(directory_ / "live/snapshot_0001.png"));
  EXPECT_FALSE(metrics_.stages.at("render").dropped.contains("failed"));
  EXPECT_GT(metrics_.counts.at("begun before the last picture was there"), 0u);
  EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);
  EXPECT_THAT(log_.text(), Not(HasSubstr("has failed")));
  EXPECT_GT(metrics_.devices.at("graphics").at("submissions"), 8u);
  EXPECT_GT(metrics_.devices.at("graphics").at("bytes up"), 0u);
  EXPECT_GE(metrics_.passes.at("present").runs, 8u);
}

// Returns the middle of a screen, of the picture's size.
std::vector<std::uint16_t> middle_of(const Plate& screen, const Plate& picture) {
  std::vector<std::uint16_t> result;
  const int left = (screen.width - picture.width) / 2, top = (screen.height - picture.height) / 2;
  for (int y = 0; y < picture.height; ++y) {
    const auto row = screen.samples.begin() + 3 * ((top + y) * screen.width + left);
    result.insert(result.end(), row, row + 3 * picture.width);
  }
  return result;
}

// The screen has a picture that was rendered, from the card's memory and bit for bit.
TEST_F(RigAsAGraphicsCard, ShowsPicturesFromTheCardsMemory) {
  write_display();
  std::mutex mutex;
  std::deque<PlatePtr> rendered;
  while_shown_ = [&] {
    const Shown shown = shown_now();
    const std::lock_guard lock(mutex);
    if (shown.shot.on_card) rendered.push_back(shown.shot.picture);
  };
  std::atomic<int> equal = 0;
  options_.on_screen = [&](const Plate& screen, const output::OsdPage&) {
    const std::lock_guard lock(mutex);
    equal += std::ranges::any_of(rendered, [&](const PlatePtr& picture) {
      return middle_of(screen, *picture) == picture->samples;
    });
  };
  run_rendering([&] {
    EXPECT_TRUE(test::wait_until("pictures are on the screen", [&] { return equal > 3; }));
  });
  EXPECT_GT(metrics_.counts.at("stayed in the card's memory"), 3u);
  EXPECT_FALSE(metrics_.counts.contains("screen: device trouble")) << log_.text();
}

// Nobody else wants the pictures, but the file of one each second.
TEST_F(RigAsAGraphicsCard, BringsNoPictureDownThatIsOnlyShown) {
  write_display();
  sees_pictures_ = false;
  std::atomic<int> screenfuls = 0;
  options_.on_screen = [&](const Plate& screen, const output::OsdPage&) {
    const auto [least, most] = std::ranges::minmax(screen.samples);
    screenfuls += most > least ? 1 : 0;
  };
  const auto stayed = [](const nlohmann::json& metrics) {
    return metrics.value("/counts/stayed in the card's memory"_json_pointer, 0);
  };
  const auto begin = std::chrono::steady_clock::now();
  run([&] {
    until_metrics("pictures stay on the card",
                  [&](const nlohmann::json& metrics) { return stayed(metrics) > 20; });
  });
  EXPECT_GT(screenfuls, 10);
  // Measured on two cores, two pictures come down each second (of which the file has one), and up
  // to two more at the beginning and the end; all that are shown would be seven or more a second. A
  // slow machine takes more seconds for the twenty that must stay.
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  constexpr std::uint64_t picture_bytes = 6 * 48 * 36;  // of the small take's, as a plate
  // Every ten seconds the samples' sums of a frame of at most 96 pixels across come down, by which
  // the light is compared with the picture.
  constexpr std::uint64_t sums_bytes = sizeof(gpu::GpuPixel) * 48 * 36;
  EXPECT_LT(metrics_.devices.at("graphics").at("bytes down"),
            std::uint64_t(2 * taken.count() + 5) * picture_bytes +
                std::uint64_t(taken.count() / 10 + 1) * (sums_bytes + picture_bytes));
  EXPECT_TRUE(std::filesystem::exists(directory_ / "live/picture.png"));
}

// Makes a frame one of a camera with colour filters: one byte a pixel.
CameraEvent mosaic_of(CameraEvent event, Camera&) {
  const auto* captured = std::get_if<FramePtr>(&event);
  if (!captured) return event;
  auto mosaic = std::make_shared<Frame>(**captured);
  mosaic->format = PixelFormat::gray8;
  mosaic->bayer = BayerPattern::grbg;
  mosaic->bytes.resize(frame_bytes(mosaic->format, mosaic->width, mosaic->height));
  return FramePtr(std::move(mosaic));
}

// The renderer gets what the camera gave, and its device makes the colours; tracking has its own.
TEST_F(RigAsAGraphicsCard, GivesTheRendererTheCamerasOwnBytes) {
  options_.around_cameras = [](live::Cameras& cameras) {
    test::put_around(cameras.observer, mosaic_of);
  };
  run_rendering([&] {
    const Shown shown = until_rendered(3);
    const FramePtr& camera = pipeline::camera_frame(shown.shot);
    EXPECT_EQ(camera->bytes.size(), shown.shot.frame->bytes.size() / 3);
    EXPECT_EQ(to_plate(*camera).samples, to_plate(*shown.shot.frame).samples);
    EXPECT_EQ(shown.shot.picture->width, camera->width);
  });
  EXPECT_FALSE(metrics_.stages.at("render").dropped.contains("failed"));
}

// Whatever a button can switch, the pipelines for it are there.
TEST_F(RigAsAGraphicsCard, CompilesNothingWhenAButtonIsPressed) {
  std::uint64_t awaited = 0;
  run_rendering([&] {
    until_metrics("all pipelines are made ahead", [&](const nlohmann::json& metrics) {
      if (!metrics.contains("counts")) return false;
      if (!metrics.at("counts").contains("all pipelines are made ahead")) return false;
      awaited = metrics.at("devices").at("graphics").at("pipelines awaited").get<std::uint64_t>();
      return true;
    });
    const auto press_and_see = [&](const std::string& button) {
      press(button);
      until_more(2);
      until_rendered(2);
    };
    for (const char* button : {"accumulate", "estimator", "light_mode", "estimator", "light_mode",
                               "light_mode", "accumulate"})
      press_and_see(button);
    press("refine");
    until_frozen(8);
  });
  const auto& counted = metrics_.devices.at("graphics");
  EXPECT_EQ(counted.at("pipelines awaited"), awaited);
  EXPECT_GT(counted.at("pipelines made ahead"), 0u);
  EXPECT_EQ(count_said("light: sources"), 1);
}

}  // namespace previz::rig::overlap_test
