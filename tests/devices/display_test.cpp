// Displays: the modes of screens as numbers, and a real screen where this machine has one to spare.
#include <dlfcn.h>
#include <unistd.h>

#include <iostream>

#include "drivers/display_drivers.hpp"
#include "drivers/display_lifeline.hpp"
#ifdef PREVIZ_WITH_KMS
#include "drivers/kms/modes.hpp"
#include "drivers/plate.hpp"
#include "tests/devices/gbm_cycle.hpp"
#include "tests/devices/leftovers.hpp"
#include "tests/support/test.hpp"

namespace {
bool has_atomic_commits = true;  // what the card is taken to say
int granted = 0, refused = 0;    // how often it was asked
}  // namespace

// In libdrm's place: a card that has no atomic commits refuses this.
extern "C" int drmSetClientCap(int card, std::uint64_t capability, std::uint64_t value) {
  static const auto in_libdrm =
      reinterpret_cast<decltype(&drmSetClientCap)>(dlsym(RTLD_NEXT, "drmSetClientCap"));
  if (capability == DRM_CLIENT_CAP_ATOMIC && !has_atomic_commits) {
    ++refused;
    return -EOPNOTSUPP;
  }
  const int result = in_libdrm(card, capability, value);
  if (capability == DRM_CLIENT_CAP_ATOMIC && result == 0) ++granted;
  return result;
}
#endif

namespace previz::display_test {

#ifdef PREVIZ_WITH_KMS
drmModeModeInfo timing(int width, int height, int clock_khz, int total_width, int total_height,
                       unsigned flags = 0) {
  drmModeModeInfo info{};
  info.hdisplay = static_cast<std::uint16_t>(width);
  info.vdisplay = static_cast<std::uint16_t>(height);
  info.clock = static_cast<std::uint32_t>(clock_khz);
  info.htotal = static_cast<std::uint16_t>(total_width);
  info.vtotal = static_cast<std::uint16_t>(total_height);
  info.flags = flags;
  return info;
}

// CTA-861's timings of 1080p50, 1080p59.94, 1080p60, 1080i50, and 720p50.
std::array<drmModeModeInfo, 5> television() {
  return {timing(1920, 1080, 148500, 2640, 1125), timing(1920, 1080, 148352, 2200, 1125),
          timing(1920, 1080, 148500, 2200, 1125),
          timing(1920, 1080, 74250, 2640, 1125, DRM_MODE_FLAG_INTERLACE),
          timing(1280, 720, 74250, 1980, 750)};
}

TEST(KmsModes, RatesComeFromThePixelClock) {
  const auto modes = television();
  const double expected[] = {50, 59.94, 60, 50, 50};
  for (std::size_t i = 0; i < modes.size(); ++i)
    EXPECT_NEAR(kms::mode_of(modes[i]).rate_hz, expected[i], 0.001) << i;
  EXPECT_EQ(kms::list_of(modes),
            "1920x1080@50, 1920x1080@59.94, 1920x1080@60, 1920x1080@50 interlaced, 1280x720@50");
}

TEST(KmsModes, TheNearestRateOfTheSizeProgressiveFirst) {
  auto modes = television();
  const auto chosen = [&](const std::optional<DisplayMode>& wanted) {
    return &kms::choose_mode(modes, wanted) - modes.data();
  };
  EXPECT_EQ(chosen(std::nullopt), 0);  // none is preferred: the first
  modes[4].type = DRM_MODE_TYPE_PREFERRED;
  EXPECT_EQ(chosen(std::nullopt), 4);
  EXPECT_EQ(chosen(DisplayMode{1920, 1080, 50}), 0);
  EXPECT_EQ(chosen(DisplayMode{1920, 1080, 59.94}), 1);
  EXPECT_EQ(chosen(DisplayMode{1920, 1080, 60}), 2);
  EXPECT_EQ(chosen(DisplayMode{1920, 1080, 0}), 2);  // the highest
  for (const DisplayMode& wanted : {DisplayMode{1920, 1080, 24}, DisplayMode{3840, 2160, 0}})
    EXPECT_THAT(test::error_of([&] { chosen(wanted); }), HasSubstr("1280x720@50"));
}

Screenful screenful(const DisplayMode& mode, int step) {
  auto plate = std::make_shared<Plate>(Plate{mode.width, mode.height, 8, {}});
  plate->samples.assign(3 * static_cast<std::size_t>(mode.width * mode.height),
                        static_cast<std::uint16_t>(step % 256));
  return {std::move(plate), {}};
}

// A screen that nobody uses: PREVIZ_TEST_SCREEN=CONNECTOR. What is on somebody's screen is not to
// be touched unasked. With atomic commits and without.
class KmsScreen : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    has_atomic_commits = GetParam();
    granted = refused = 0;
    const char* connector = std::getenv("PREVIZ_TEST_SCREEN");
    if (!connector)
      GTEST_SKIP() << "no screen to spare: PREVIZ_TEST_SCREEN names no connector of this machine";
    settings_.connector = connector;
    for (const FoundDisplay& found : display_driver("kms").find())
      if (found.connector == connector && found.description.find("640x480") != std::string::npos)
        settings_.mode = DisplayMode{640, 480, 0};  // a small one, for the sake of emulated cards
  }
  std::unique_ptr<Display> open() { return display_driver("kms").open(settings_); }

  void TearDown() override { has_atomic_commits = true; }

  DisplaySettings settings_;
};

TEST_P(KmsScreen, FlipsAtItsPaceAndTellsWhen) {
  const auto display = open();
  EXPECT_EQ(display->name(), settings_.connector);
  EXPECT_EQ(granted > 0, GetParam());
  EXPECT_EQ(refused > 0, !GetParam());
  const DisplayMode mode = display->mode();
  std::int64_t last_ns = 0;
  for (int i = 0; i < 5; ++i) {
    const DisplayEvent event = display->show(screenful(mode, 20 * i));
    ASSERT_TRUE(std::holds_alternative<Shown>(event)) << std::get<DeviceTrouble>(event).what;
    EXPECT_GT(std::get<Shown>(event).timestamp_ns, last_ns);
    last_ns = std::get<Shown>(event).timestamp_ns;
  }
  EXPECT_TRUE(display->read_back().samples == screenful(mode, 20 * 4).picture->samples);
}

TEST_P(KmsScreen, IsReleasedToOthersAndTakenBack) {
  const auto display = open();
  const DisplayMode mode = display->mode();
  ASSERT_TRUE(std::holds_alternative<Shown>(display->show(screenful(mode, 100))));
  display->release();
  {
    const auto other = open();
    EXPECT_TRUE(std::holds_alternative<Shown>(other->show(screenful(mode, 50))));
    const DisplayEvent refused = display->show(screenful(mode, 100));
    ASSERT_TRUE(std::holds_alternative<DeviceTrouble>(refused));
    EXPECT_FALSE(std::get<DeviceTrouble>(refused).lost);
    EXPECT_THROW(open(), Error);
  }
  EXPECT_TRUE(std::holds_alternative<Shown>(display->show(screenful(mode, 100))));
}

TEST_P(KmsScreen, IsOpenedAgainAndAgainWithoutALeak) {
  std::size_t first = 0;
  for (int i = 0; i < 5; ++i) {
    const auto display = open();
    ASSERT_TRUE(std::holds_alternative<Shown>(display->show(screenful(display->mode(), 10 * i))));
    if (i == 1) first = test::open_descriptors();
  }
  EXPECT_LE(test::open_descriptors(), first);
}

// The cable by the kernel's own switch for connectors, and its word that something has changed.
class Cable {
 public:
  explicit Cable(const std::string& connector) {
    for (const auto& entry : std::filesystem::directory_iterator("/sys/class/drm"))
      if (entry.path().filename().string().ends_with("-" + connector)) connector_ = entry.path();
  }
  bool may_be_pulled() const {
    return !connector_.empty() && access((connector_ / "status").c_str(), W_OK) == 0;
  }
  std::string card() const {
    const std::string name = connector_.filename();
    return "/dev/dri/" + name.substr(0, name.find('-'));
  }
  void pull() { set("off"); }
  void plug() { set("detect"); }

 private:
  void set(const char* status) {
    std::ofstream(connector_ / "status") << status;
    std::ofstream(connector_ / "device/uevent") << "change";  // of the card
  }
  std::filesystem::path connector_;
};

// A display that is never given up, asked frame by frame.
class Life {
 public:
  explicit Life(const DisplaySettings& settings)
      : life_(settings.connector,
              [this, settings] {
                std::unique_ptr<Display> display = display_driver("kms").open(settings);
                ++openings_;
                return display;
              },
              {std::chrono::milliseconds(10), std::chrono::milliseconds(10)}) {}
  Life(const Life&) = delete;
  Life& operator=(const Life&) = delete;

  // "shown", trouble's words, or nothing.
  std::string next() {
    const auto event = life_.show([](const DisplayMode& mode) { return screenful(mode, 100); });
    if (!event) return "";
    const auto* trouble = std::get_if<DeviceTrouble>(&*event);
    return trouble ? trouble->what : "shown";
  }
  // Returns the first report with these words, or the last report within ten seconds.
  std::string until(const std::string& words) {
    std::string last;
    for (int i = 0; i < 500 && last.find(words) == std::string::npos; ++i) {
      if (i > 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      last = next();
    }
    return last;
  }
  std::size_t openings() const { return openings_; }
  bool has_display() { return life_.display() != nullptr; }

 private:
  std::size_t openings_ = 0;
  DisplayLifeline life_;
};

TEST_P(KmsScreen, IsGivenUpWhenItIsUnpluggedAndBackAfterIt) {
  Cable cable(settings_.connector);
  if (!cable.may_be_pulled()) GTEST_SKIP() << "the kernel's switch of connectors needs root";
  Life life(settings_);
  EXPECT_EQ(life.next(), "shown");
  cable.pull();
  EXPECT_EQ(life.until("unplugged"), "the screen was unplugged; reopening it");
  EXPECT_EQ(life.until("no screen"),
            settings_.connector + ": no screen is plugged in; retrying until it is available");
  EXPECT_FALSE(life.has_display());
  cable.plug();
  EXPECT_EQ(life.until("shown"), "shown");
}

// Screens are opened the same way with atomic commits and without.
class KmsCable : public KmsScreen {};

TEST_P(KmsCable, AHundredTimesUnpluggedLeavesNothingBehind) {
  Cable cable(settings_.connector);
  if (!cable.may_be_pulled()) GTEST_SKIP() << "the kernel's switch of connectors needs root";
  constexpr int cycles = 100, warm_cycles = 10;
  Life life(settings_);
  std::size_t descriptors = 0, bytes = 0, mappings = 0, openings = 0;
  for (int cycle = 0; cycle < cycles; ++cycle) {
    ASSERT_EQ(life.until("shown"), "shown") << "cycle " << cycle;
    if (cycle == warm_cycles) {
      descriptors = test::open_descriptors();
      bytes = test::live_bytes();
      mappings = test::mappings();
      openings = life.openings();
    }
    cable.pull();
    ASSERT_THAT(life.until("unplugged"), HasSubstr("unplugged")) << "cycle " << cycle;
    cable.plug();
  }
  ASSERT_EQ(life.until("shown"), "shown");
  EXPECT_EQ(test::open_descriptors(), descriptors);
  // A framebuffer left behind in each cycle would be as many mappings as cycles, a context far more
  // bytes than this beside what GBM and EGL keep.
  EXPECT_LT(test::mappings(), mappings + (cycles - warm_cycles) / 2);
  const std::size_t kept = test::live_bytes() - std::min(bytes, test::live_bytes());
  const std::size_t opened = life.openings() - openings;
  const std::size_t by_gbm_and_egl = test::bytes_that_gbm_and_egl_keep(cable.card());
  std::cout << kept / opened << " bytes kept by each of " << opened << " openings, "
            << by_gbm_and_egl << " of them by GBM and EGL\n";
  EXPECT_LT(kept, opened * (by_gbm_and_egl + 1024));
}

TEST_P(KmsScreen, AnUnknownConnectorOrModeIsToldWithWhatThereIs) {
  DisplaySettings wrong = settings_;
  wrong.mode = DisplayMode{1234, 567, 0};
  for (const DisplaySettings& settings : {DisplaySettings{"DSI-7", {}, {}}, wrong})
    EXPECT_THAT(test::error_of([&] { display_driver("kms").open(settings); }),
                HasSubstr(settings_.connector));
}

INSTANTIATE_TEST_SUITE_P(Cards, KmsScreen, testing::Bool(), [](const auto& instance) {
  return std::string(instance.param ? "Atomic" : "BeforeAtomic");
});

INSTANTIATE_TEST_SUITE_P(Cards, KmsCable, testing::Values(true),
                         [](const auto&) { return std::string("Atomic"); });
#endif

}  // namespace previz::display_test
