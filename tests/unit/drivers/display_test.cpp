// What a display shows, read back: where the picture goes, its colours, overlays; and its life.
#include "drivers/display.hpp"

#include "drivers/display_drivers.hpp"
#include "drivers/display_lifeline.hpp"
#include "drivers/gles/placement.hpp"
#include "drivers/headless/headless_display.hpp"
#include "drivers/plate.hpp"
#include "tests/support/test.hpp"

namespace previz::display_test {

using gles::place;
using gles::Rectangle;

TEST(DisplayMode, IsReadAndWrittenTheSame) {
  EXPECT_EQ(parse_display_mode("1920x1080@50"), (DisplayMode{1920, 1080, 50}));
  EXPECT_EQ(parse_display_mode("800x600"), (DisplayMode{800, 600, 0}));
  EXPECT_EQ(to_string(*parse_display_mode("1920x1080@59.94")), "1920x1080@59.94");
  EXPECT_EQ(to_string(DisplayMode{800, 600, 0}), "800x600");
  for (const char* wrong : {"", "1920", "1920x", "x1080", "1920x1080@", "1920x1080@0", "0x10",
                            "-5x10", "1920x1080p", "1920x1080@50i", "99999x10", "1920 x 1080"})
    EXPECT_FALSE(parse_display_mode(wrong)) << wrong;
}

// The picture's shape, as large as fits, in the middle; by hand.
TEST(DisplayPlacement, LetterboxIsTheLargestOfTheSameShape) {
  const auto boxed = [](int w, int h, int screen_w, int screen_h) {
    return place(w, h, screen_w, screen_h, DisplayScale::letterbox);
  };
  EXPECT_EQ(boxed(1920, 1080, 1920, 1080), (Rectangle{0, 0, 1920, 1080}));
  EXPECT_EQ(boxed(640, 480, 1920, 1080), (Rectangle{240, 0, 1440, 1080}));   // pillars
  EXPECT_EQ(boxed(2048, 858, 1920, 1080), (Rectangle{0, 138, 1920, 804}));   // 804.375 rows
  EXPECT_EQ(boxed(4096, 2160, 1280, 1024), (Rectangle{0, 174, 1280, 675}));  // odd border
  EXPECT_EQ(boxed(1, 10000, 1280, 720), (Rectangle{639, 0, 1, 720}));        // never nothing
}

TEST(DisplayPlacement, OneToOneIsCentredAndCutOff) {
  const auto centred = [](int w, int h, int screen_w, int screen_h) {
    return place(w, h, screen_w, screen_h, DisplayScale::one_to_one);
  };
  EXPECT_EQ(centred(640, 480, 1920, 1080), (Rectangle{640, 300, 640, 480}));
  EXPECT_EQ(centred(101, 11, 200, 20), (Rectangle{49, 4, 101, 11}));
  EXPECT_EQ(centred(4096, 2160, 1920, 1080), (Rectangle{-1088, -540, 4096, 2160}));
}

// Every 8-bit value in every channel, no two alike beside each other.
std::shared_ptr<const Plate> every_value(int width, int height, int bits = 8) {
  Plate plate{width, height, bits, {}};
  for (int i = 0; i < width * height; ++i)
    for (const int factor : {1, 7, 13}) {
      const int value = i * factor % 256;
      plate.samples.push_back(static_cast<std::uint16_t>(bits == 16 ? value * 257 : value));
    }
  return std::make_shared<const Plate>(std::move(plate));
}

DisplaySettings settings(int width, int height, DisplayScale scale = DisplayScale::letterbox) {
  return {"", DisplayMode{width, height, 0}, scale};
}

std::vector<std::uint16_t> pixel(const Plate& plate, int x, int y) {
  const auto* first = &plate.samples[3 * static_cast<std::size_t>(y * plate.width + x)];
  return {first, first + 3};
}

const std::vector<std::uint16_t> black = {0, 0, 0};

TEST(HeadlessDisplay, ShowsEveryColourAsItIs) {
  const auto display = open_headless(settings(64, 24));
  EXPECT_EQ(display->mode(), (DisplayMode{64, 24, 0}));
  for (const int bits : {8, 16}) {
    ASSERT_TRUE(std::holds_alternative<Shown>(display->show({every_value(64, 24, bits), {}})));
    EXPECT_TRUE(display->read_back().samples == every_value(64, 24)->samples) << bits;
  }
}

// 16 bits are rounded to the nearest of 8: v * 255 / 65535.
TEST(HeadlessDisplay, RoundsDeepSamples) {
  auto deep = std::make_shared<Plate>(Plate{256, 2, 16, {}});
  std::vector<std::uint16_t> expected;
  for (int i = 0; i < 3 * 512; ++i) {
    const int value = i * 65535 / (3 * 512 - 1);
    deep->samples.push_back(static_cast<std::uint16_t>(value));
    expected.push_back(static_cast<std::uint16_t>(std::lround(value * 255.0 / 65535.0)));
  }
  const auto display = open_headless(settings(256, 2));
  display->show({deep, {}});
  EXPECT_TRUE(display->read_back().samples == expected);
}

TEST(HeadlessDisplay, OneToOneInTheMiddleAndCutOff) {
  const auto picture = every_value(40, 20);
  const auto display = open_headless(settings(60, 10, DisplayScale::one_to_one));
  display->show({picture, {}});
  const Plate screen = display->read_back();
  for (int y = 0; y < 10; ++y)
    for (int x = 0; x < 60; ++x) {
      const bool inside = x >= 10 && x < 50;
      EXPECT_EQ(pixel(screen, x, y), inside ? pixel(*picture, x - 10, y + 5) : black)
          << x << ',' << y;
    }
}

// Twice as large: the picture's own colours at its edges, black beside it, in between linear.
TEST(HeadlessDisplay, LetterboxScalesLinearlyAndLeavesTheRestBlack) {
  auto ramp = std::make_shared<Plate>(Plate{4, 4, 8, {}});
  for (int y = 0; y < 4; ++y)
    for (const int x : {0, 1, 2, 3})
      for (int c = 0; c < 3; ++c) ramp->samples.push_back(static_cast<std::uint16_t>(40 + 40 * x));
  const auto display = open_headless(settings(12, 8));
  display->show({ramp, {}});
  const Plate screen = display->read_back();
  // Pixel i of 8 is at (i + 1/2) / 2 - 1/2 of the picture's 4.
  const int expected[] = {0, 0, 40, 50, 70, 90, 110, 130, 150, 160, 0, 0};
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 12; ++x)
      EXPECT_NEAR(pixel(screen, x, y)[0], expected[x], 1) << x << ',' << y;  // 8-bit weights
}

TEST(HeadlessDisplay, ManyPixelsInOneAreTheirMean) {
  auto checkers = std::make_shared<Plate>(Plate{256, 256, 8, {}});
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x)
      checkers->samples.insert(checkers->samples.end(), 3, (x + y) % 2 == 0 ? 255 : 0);
  const auto display = open_headless(settings(16, 16));
  display->show({checkers, {}});
  for (const std::uint16_t sample : display->read_back().samples)
    EXPECT_NEAR(sample, 127.5, 1.5);  // rounded once a halving at most
}

TEST(HeadlessDisplay, OverlaysLieAboveThePictureAndNowhereElse) {
  const auto picture = every_value(64, 24);
  const auto display = open_headless(settings(64, 24));
  Overlay opaque{5, 3, 4, 2, {}};
  for (int i = 0; i < 8; ++i)
    opaque.rgba.insert(opaque.rgba.end(), {10, static_cast<std::uint8_t>(100 + i), 30, 255});
  Overlay half{60, 20, 8, 8, {}};  // reaches beyond the screen
  for (int i = 0; i < 64; ++i) half.rgba.insert(half.rgba.end(), {0, 0, 0, 128});
  display->show({picture, {opaque, half}});
  const Plate screen = display->read_back();
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 64; ++x) {
      const std::vector<std::uint16_t> under = pixel(*picture, x, y);
      if (x >= 5 && x < 9 && y >= 3 && y < 5) {
        const int i = (y - 3) * 4 + x - 5;
        EXPECT_EQ(pixel(screen, x, y),
                  (std::vector<std::uint16_t>{10, static_cast<std::uint16_t>(100 + i), 30}));
      } else if (x >= 60 && y >= 20) {
        EXPECT_NEAR(pixel(screen, x, y)[1], under[1] * 127 / 255.0, 1);
      } else {
        EXPECT_EQ(pixel(screen, x, y), under) << x << ',' << y;
      }
    }
  display->show({picture, {}});
  EXPECT_TRUE(display->read_back().samples == picture->samples);
}

TEST(HeadlessDisplay, IsDarkWithoutAPictureAndWhenReleased) {
  const auto display = open_headless(settings(16, 8));
  const std::vector<std::uint16_t> dark(3 * 16 * 8, 0);
  display->show({});
  EXPECT_EQ(display->read_back().samples, dark);
  const auto picture = every_value(16, 8);
  display->show({picture, {}});
  display->release();
  EXPECT_EQ(display->read_back().samples, dark);
  display->show({picture, {}});
  EXPECT_EQ(display->read_back().samples, picture->samples);
}

TEST(DisplayDrivers, NamesWhatThisBuildHas) {
  EXPECT_STREQ(display_driver("headless").name, "headless");
  EXPECT_THAT(test::error_of([] { display_driver("projector"); }), HasSubstr("headless"));
}

// A screen whose cable the test holds.
struct Cable {
  bool plugged = false, taken = false;
  int opened = 0;
};
class PluggedScreen final : public Display {
 public:
  explicit PluggedScreen(Cable& cable) : cable_(cable) {
    if (!cable.plugged) throw Error("no screen is plugged in");
    ++cable.opened;
  }
  std::string name() const override { return "screen"; }
  DisplayMode mode() const override { return {8, 8, 50}; }
  DisplayEvent show(const Screenful&) override {
    if (!cable_.plugged) return DeviceTrouble{"screen", "was unplugged", true};
    if (cable_.taken) return DeviceTrouble{"screen", "another program has it", false};
    return previz::Shown{1};
  }
  void release() override {}
  Plate read_back() override { return {}; }

 private:
  Cable& cable_;
};

TEST(DisplayLifeline, OpensWaitsBacksOffAndOpensAgain) {
  using namespace std::chrono_literals;
  HostClock::Time now{};
  Cable cable;
  HostClock clock;
  clock.now = [&] { return now; };
  DisplayLifeline life(
      "HDMI-A-1", [&] { return std::make_unique<PluggedScreen>(cable); }, {100ms, 400ms}, clock);
  const auto report = [&]() -> std::string {
    const auto event = life.show([](const DisplayMode& mode) {
      EXPECT_EQ(mode, (DisplayMode{8, 8, 50}));
      return Screenful{};
    });
    if (!event) return "";
    if (std::holds_alternative<previz::Shown>(*event)) return "shown";
    return std::get<DeviceTrouble>(*event).device + ": " + std::get<DeviceTrouble>(*event).what;
  };
  EXPECT_EQ(life.state(), DeviceState::absent);
  EXPECT_EQ(report(), "HDMI-A-1: no screen is plugged in; retrying until it is available");
  cable.plugged = true;
  EXPECT_EQ(report(), "");  // not before its time
  now += 100ms;
  EXPECT_EQ(report(), "shown");
  EXPECT_EQ(life.state(), DeviceState::streaming);

  cable.taken = true;  // stays open; reported once
  EXPECT_EQ(report(), "HDMI-A-1: another program has it");
  EXPECT_EQ(report(), "");
  cable.taken = false;
  EXPECT_EQ(report(), "shown");

  cable.plugged = false;
  EXPECT_EQ(report(), "HDMI-A-1: was unplugged; reopening it");
  EXPECT_EQ(life.state(), DeviceState::lost);
  EXPECT_EQ(life.display(), nullptr);
  now += 100ms;
  EXPECT_EQ(report(), "HDMI-A-1: no screen is plugged in; retrying until it is available");
  now += 199ms;  // then 200
  cable.plugged = true;
  EXPECT_EQ(report(), "");
  now += 1ms;
  EXPECT_EQ(report(), "shown");
  EXPECT_EQ(cable.opened, 2);
}

}  // namespace previz::display_test
