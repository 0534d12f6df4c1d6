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
// A small card left of it, whose sides are 48 px long: 4 pieces of edges.
constexpr double small_half_m = 0.06, small_right_px = -110;

// A real card of 0.3 m, seen from a metre above; its sides are 120 px long.
class RigGuides : public test::RigLive {
 protected:
  RigGuides() {
    options_.on_screen = [this](const Plate&, const OsdPage& page) { pages_.show(page); };
  }

  // The model of the card is so many pixels to the right of it, and that of the small one, if there
  // is one, likewise.
  void write_take(double off_px, std::optional<double> small_off_px = {}) {
    test::write_square(directory_ / "card.gltf", 2 * half_side_m, 0);
    session::SessionInfo info;
    info.set_text =
        "[set]\nname = 'card'\n[observer]\ndriver = 'replay'\ndevice = 'session'\n"
        "[light_camera]\ndriver = 'none'\n[tracking]\nenabled = false\n[lighting]\nfrom = "
        "'set'\n[quality]\nsamples = 1\n"
        "[display]\ndriver = 'headless'\nmode = '640x480'\n"
        "[[object]]\nname = 'card'\nfile = 'card.gltf'\npresence = 'phantom'\nposition_m = [" +
        std::to_string(off_px / focal_px) + ", 0.0, 0.0]\n" + test::button_for_every_action();
    if (small_off_px) {
      test::write_square(directory_ / "small.gltf", 2 * small_half_m, 0);
      info.set_text +=
          "[[object]]\nname = 'small card'\nfile = 'small.gltf'\npresence = 'phantom'\n"
          "position_m = [" +
          std::to_string((small_right_px + *small_off_px) / focal_px) + ", 0.0, 0.0]\n";
    }
    std::ofstream(directory_ / "set.toml") << info.set_text;
    info.observer.emplace();
    info.observer->intrinsics = test::plain_lens(width, height, focal_px);
    session::SessionWriter writer(directory_ / "session", info);
    for (int i = 0; i < 5; ++i) {
      Frame frame = picture(small_off_px.has_value());
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

  static Frame picture(bool has_small) {
    test::LinearPicture light{width, height, std::vector<double>(std::size_t{width} * height, 0.3)};
    const double half = focal_px * half_side_m, x = 0.5 * (width - 1), y = 0.5 * (height - 1);
    add_polygon(
        light,
        {{x - half, y - half}, {x + half, y - half}, {x + half, y + half}, {x - half, y + half}},
        0.4);
    if (has_small) {
      const double sx = x + small_right_px, s = focal_px * small_half_m;
      add_polygon(light, {{sx - s, y - s}, {sx + s, y - s}, {sx + s, y + s}, {sx - s, y + s}}, 0.4);
    }
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

// It takes pictures of two seconds to have pieces enough.
TEST_F(RigGuides, NameTheThingThatWasMoved) {
  write_take(0, 6);
  run([&] {
    press("guides");
    pages_.until([](const OsdPage& page) {
      return says(page.notices, "\"small card\" off by 6.0 px: moved, or misplaced in the model");
    });
    until_metrics("the thing is named", [](const nlohmann::json& metrics) {
      const nlohmann::json& fit = metrics["model_fit_px"];
      return fit.is_object() && fit["things_off"].size() == 1 &&
             fit["things_off"][0]["name"] == "small card";
    });
  });
}

TEST_F(RigGuides, MeasureNothingWhileTheyAreOff) {
  write_take(0);
  run([&] { until_more(8); });  // the first would be measured
  EXPECT_FALSE(metrics_.stages.contains("model fit"));
}

}  // namespace previz::rig::guides_live_test
