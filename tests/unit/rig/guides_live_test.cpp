// What the crew is told of a model that fits the live picture, and of one that does not: on the
// display and in metrics.json.
#include "tests/support/live_rig.hpp"
#include "tests/support/pages.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::rig::guides_live_test {

using output::OsdPage;
using test::says;

constexpr int width = 320, height = 240;
constexpr double focal_px = 400, half_side_m = 0.15;

// A real card of 0.3 m, seen from a metre above; its sides are 120 px long.
class RigGuides : public test::RigLive {
 protected:
  RigGuides() {
    options_.on_screen = [this](const Plate&, const OsdPage& page) { pages_.show(page); };
  }

  // The model of the card is so many pixels to the right of it.
  void write_take(double off_px) {
    test::write_square(directory_ / "card.gltf", 2 * half_side_m, 0);
    session::SessionInfo info;
    info.set_text =
        "[set]\nname = 'card'\n[observer]\ndriver = 'replay'\ndevice = 'session'\n"
        "[light_camera]\ndriver = 'none'\n[tracking]\nenabled = false\n[lighting]\nfrom = "
        "'set'\n[quality]\nsamples = 1\n"
        "[display]\ndriver = 'headless'\nmode = '640x480'\n"
        "[[object]]\nname = 'card'\nfile = 'card.gltf'\npresence = 'phantom'\nposition_m = [" +
        std::to_string(off_px / focal_px) + ", 0.0, 0.0]\n" + test::button_for_every_action();
    std::ofstream(directory_ / "set.toml") << info.set_text;
    info.observer.emplace();
    info.observer->intrinsics = test::plain_lens(width, height, focal_px);
    session::SessionWriter writer(directory_ / "session", info);
    for (int i = 0; i < 5; ++i) {
      Frame frame = picture();
      frame.timestamp_ns = frame.arrival_ns = 1'000'000 + i * test::small_take_interval_ns;
      frame.sequence = static_cast<std::uint64_t>(i);
      writer.write(frame);
      session::TrackRecord record;
      record.frame = frame.sequence;
      record.timestamp_ns = frame.timestamp_ns;
      record.tracked = true;
      record.world_from_camera = {{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 1, 1}};
      writer.write(record);
    }
    writer.close();
  }

  static Frame picture() {
    test::LinearPicture light{width, height, std::vector<double>(std::size_t{width} * height, 0.3)};
    const double half = focal_px * half_side_m, x = 0.5 * (width - 1), y = 0.5 * (height - 1);
    add_polygon(
        light,
        {{x - half, y - half}, {x + half, y - half}, {x + half, y + half}, {x - half, y + half}},
        0.4);
    std::mt19937 random(1);
    Frame frame = expose(light, test::Sensor{}, random);
    frame.source = "observer";
    return frame;
  }

  // Waits for the shift of the model in metrics.json; nothing: for null.
  void until_shift(std::optional<double> px) {
    until_metrics("the model's shift is right", [&](const nlohmann::json& metrics) {
      if (!metrics.contains("model_fit_px")) return false;
      const nlohmann::json& fit = metrics["model_fit_px"];
      return px ? fit.is_object() && fit["shift"] == *px : fit.is_null();
    });
  }

  test::Pages pages_;
};

TEST_F(RigGuides, SayHowFarTheModelIsFromThePictureWhileTheyAreOn) {
  write_take(0);
  run([&] {
    until_shift({});
    press("guides");
    pages_.until([](const OsdPage& page) { return says(page.bottom_right, "model 0."); });
    until_shift(0.0);
    press("guides");
    pages_.until([](const OsdPage& page) {
      return says(page.notices, "guides off") && !says(page.bottom_right, "model");
    });
    until_shift({});
  });
  EXPECT_GT(metrics_.stages.at("model fit").frames, 0u);
}

TEST_F(RigGuides, GiveTheAlarmIfTheModelIsOff) {
  write_take(6);
  run([&] {
    press("guides");
    pages_.until([](const OsdPage& page) {
      return says(page.notices, "model off by 6.0 px: check phantom or tags");
    });
    until_shift(6.0);
  });
}

TEST_F(RigGuides, MeasureNothingWhileTheyAreOff) {
  write_take(0);
  run([&] { until_more(8); });  // the first would be measured
  EXPECT_FALSE(metrics_.stages.contains("model fit"));
}

}  // namespace previz::rig::guides_live_test
