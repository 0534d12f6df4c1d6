// Every camera driver must pass these tests, whatever device stands behind it; see
// drivers/camera.hpp.
#include "tests/devices/device_under_test.hpp"
#include "tests/support/test.hpp"

namespace previz::test::camera_compliance_test {

using std::chrono::milliseconds;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// Far beyond what any device takes for a frame; reached only by a failure.
constexpr std::chrono::seconds patience{20};

using Duration = std::chrono::duration<double>;

class CameraCompliance : public testing::TestWithParam<RegisteredDevice> {
 protected:
  void SetUp() override {
    std::string why_not = "no reason was given";
    device_ = GetParam().make(why_not);
    if (!device_) GTEST_SKIP() << why_not;
  }

  // The next frame; none where none comes in a long time or the device is lost.
  FramePtr next_frame(Camera& camera) {
    for (const auto end = Clock::now() + patience; Clock::now() < end;) {
      CameraEvent event = camera.next(200ms);
      if (auto* frame = std::get_if<FramePtr>(&event)) return std::move(*frame);
      if (const auto* trouble = std::get_if<DeviceTrouble>(&event)) {
        EXPECT_EQ(trouble->device, camera.name());
        EXPECT_TRUE(device_->may_lose_frames() && !trouble->lost) << trouble->what;
        if (trouble->lost) return nullptr;
      } else if (std::holds_alternative<EndOfStream>(event)) {
        return nullptr;
      }
    }
    return nullptr;
  }

  // `count` frames, each checked against the one before, also of an earlier call.
  void take(Camera& camera, int count) {
    for (int i = 0; i < count; ++i) {
      FramePtr frame = next_frame(camera);
      ASSERT_TRUE(frame) << "frame " << i << " of " << count << " did not come; counted were "
                         << testing::PrintToString(camera.counters());
      check(*frame, camera.format());
      last_ = std::move(frame);
    }
  }

  void check(const Frame& frame, const CameraFormat& format) {
    EXPECT_EQ(frame.format, format.format);
    EXPECT_EQ(frame.width, format.width);
    EXPECT_EQ(frame.height, format.height);
    EXPECT_EQ(frame.bytes.size(), frame_bytes(format.format, format.width, format.height));
    EXPECT_GT(frame.exposure, 0);
    EXPECT_GE(frame.arrival_ns, frame.timestamp_ns);
    if (!last_) return;
    EXPECT_GT(frame.sequence, last_->sequence);
    EXPECT_GT(frame.timestamp_ns, last_->timestamp_ns);
  }

  void expect_silence(Camera& camera) {
    EXPECT_TRUE(std::holds_alternative<NoFrame>(camera.next(0ms)));
    EXPECT_TRUE(std::holds_alternative<NoFrame>(camera.next(50ms)));
  }

  // Until the device says that it is lost; frames before that may still come.
  std::optional<DeviceTrouble> wait_until_lost(Camera& camera) {
    for (const auto end = Clock::now() + patience; Clock::now() < end;) {
      const CameraEvent event = camera.next(100ms);
      const auto* trouble = std::get_if<DeviceTrouble>(&event);
      if (trouble && trouble->lost) return *trouble;
    }
    return std::nullopt;
  }

  // Returns by how much a call for a frame lasts longer than it was allowed to, where no frame
  // came: the median of some calls, which is not moved by those that the machine interrupted.
  // Returns nothing where frames came always.
  std::optional<Duration> overrun(Camera& camera, milliseconds asked) {
    std::vector<Duration> in_vain;
    for (int i = 0; i < 21; ++i) {
      const auto begin = Clock::now();
      if (std::holds_alternative<NoFrame>(camera.next(asked)))
        in_vain.push_back(Clock::now() - begin - asked);
    }
    return median(std::move(in_vain));
  }

  static std::optional<Duration> median(std::vector<Duration> durations) {
    if (durations.empty()) return std::nullopt;
    const auto middle = durations.begin() + static_cast<std::ptrdiff_t>(durations.size() / 2);
    std::ranges::nth_element(durations, middle);
    return *middle;
  }

  // How long a frame lasts; a camera that does not say its rate is taken for one of 60 Hz.
  static Duration frame_of(const Camera& camera) {
    return Duration(1 / (camera.format().rate_hz > 0 ? camera.format().rate_hz : 60));
  }

  std::unique_ptr<Camera> started() const {
    std::unique_ptr<Camera> camera = device_->open();
    camera->start();
    return camera;
  }

  std::unique_ptr<DeviceUnderTest> device_;
  FramePtr last_;
};

TEST_P(CameraCompliance, SaysWhatItsPicturesAreBeforeItStreams) {
  const auto camera = device_->open();
  EXPECT_FALSE(camera->name().empty());
  EXPECT_GT(camera->format().width, 0);
  EXPECT_GT(camera->format().height, 0);
  expect_silence(*camera);
}

TEST_P(CameraCompliance, DeliversWhileItStreamsAndNothingAfterwards) {
  const auto camera = device_->open();
  for (const int count : {1, 3, 2, 7}) {
    camera->start();
    ASSERT_NO_FATAL_FAILURE(take(*camera, count));
    camera->stop();
    if (count != 3) expect_silence(*camera);  // after 3 it is started again at once
  }
}

// Where frames are lost on the way, the gap says how many: the camera's clock has gone on by no
// less than nine tenths of what they last at its nominal rate, but for one frame.
TEST_P(CameraCompliance, NumbersEveryFrameItCaptures) {
  const auto camera = started();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 1));
  const FramePtr first = last_;
  ASSERT_NO_FATAL_FAILURE(take(*camera, 8));
  const auto numbered = last_->sequence - first->sequence;
  EXPECT_GE(numbered, 8u);
  if (!device_->may_lose_frames()) {
    EXPECT_EQ(numbered, 8u);
  } else if (camera->format().rate_hz > 0) {
    const double seconds = 1e-9 * static_cast<double>(last_->timestamp_ns - first->timestamp_ns);
    EXPECT_LE(static_cast<double>(numbered), seconds * camera->format().rate_hz / 0.9 + 1);
  }
}

TEST_P(CameraCompliance, StartsAndStopsWithoutAFrameTaken) {
  const auto camera = device_->open();
  for (int i = 0; i < 3; ++i) {
    camera->start();
    camera->start();
    camera->stop();
    camera->stop();
  }
  camera->start();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 1));
}

// Frames lie captured and untaken when the stream stops; none of them may come after it starts.
TEST_P(CameraCompliance, StopsWithRequestsInFlight) {
  const auto camera = started();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 1));
  std::this_thread::sleep_for(150ms);  // some frames long: they are captured, and nobody takes them
  camera->stop();
  const std::int64_t stopped_ns = std::chrono::nanoseconds(Clock::now().time_since_epoch()).count();
  expect_silence(*camera);
  camera->start();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 2));
  if (GetParam().live) {
    EXPECT_GT(last_->timestamp_ns, stopped_ns);
  }
}

TEST_P(CameraCompliance, ClosesWhileItStreams) {
  for (int i = 0; i < 3; ++i) {
    const auto camera = started();
    ASSERT_NO_FATAL_FAILURE(take(*camera, 2));
    if (i < 2) last_ = nullptr;  // a device may count anew when it is opened
  }
}

// A call that finds nothing returns at once: within a tenth of the time that a frame lasts. The
// median is not moved by calls that the machine interrupted. Where every call finds a frame there
// is nothing to wait for.
TEST_P(CameraCompliance, DoesNotWaitWhereItIsAskedNotTo) {
  const auto camera = started();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 1));
  const auto enough = Clock::now() + patience;
  std::vector<Duration> in_vain;
  for (int i = 0; i < 1000 && in_vain.size() < 101; ++i) {
    const auto begin = Clock::now();
    ASSERT_LT(begin, enough) << "a thousand calls take longer than that";
    if (std::holds_alternative<NoFrame>(camera->next(0ms))) in_vain.push_back(Clock::now() - begin);
  }
  if (const auto middle = median(in_vain)) {
    EXPECT_LT(*middle, 0.1 * frame_of(*camera));
  }
}

// A camera waits in whole milliseconds, and may decode one frame more. That lasts no longer than a
// frame, or the camera could not keep up with itself.
TEST_P(CameraCompliance, ReturnsByItsDeadlineWhateverComes) {
  const auto camera = started();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 1));
  const Duration frame = frame_of(*camera), millisecond(0.001);
  const auto half = std::chrono::floor<milliseconds>(frame / 2);
  if (const auto over = overrun(*camera, half)) {
    EXPECT_LT(*over, 0.1 * frame + millisecond);
  }
  if (!device_->spoil()) return;
  for (const milliseconds asked : {half, 100ms}) {
    if (const auto over = overrun(*camera, asked)) {
      EXPECT_LT(*over, frame + millisecond) << asked.count();
    }
  }
}

TEST_P(CameraCompliance, ExposuresAppliedAreOnTheirFrames) {
  const auto camera = started();
  if (device_->exposures().empty()) {
    EXPECT_FALSE(camera->set_exposure(0.01, 1));
    return;
  }
  for (int round = 0; round < 2; ++round) {
    for (const auto& [exposure_s, gain] : device_->exposures()) {
      ASSERT_TRUE(camera->set_exposure(exposure_s, gain));
      bool applied = false;
      for (int i = 0; i < 20 && !applied; ++i) {
        ASSERT_NO_FATAL_FAILURE(take(*camera, 1));
        EXPECT_NE(device_->shows_its_exposure(*last_), false) << last_->sequence;
        applied = std::abs(last_->exposure_s - exposure_s) < 1e-6 * exposure_s &&
                  std::abs(last_->gain - gain) < 1e-6 * gain;
      }
      EXPECT_TRUE(applied) << exposure_s << " s, gain " << gain;
    }
  }
}

// The cable is pulled.
class CameraUnplugged : public CameraCompliance {
 protected:
  void SetUp() override {
    CameraCompliance::SetUp();
    if (device_ && !device_->why_no_cable().empty()) GTEST_SKIP() << device_->why_no_cable();
  }
};

TEST_P(CameraUnplugged, TellsSoWhileItStreams) {
  const auto camera = started();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 3));
  device_->unplug();
  const std::optional<DeviceTrouble> trouble = wait_until_lost(*camera);
  ASSERT_TRUE(trouble);
  EXPECT_EQ(trouble->device, camera->name());
  EXPECT_FALSE(trouble->what.empty());
  const CameraEvent after = camera->next(0ms);
  EXPECT_TRUE(std::holds_alternative<DeviceTrouble>(after));
  camera->stop();
}

TEST_P(CameraUnplugged, ReopensWhenItIsBack) {
  for (int i = 0; i < 2; ++i) {
    auto camera = started();
    ASSERT_NO_FATAL_FAILURE(take(*camera, 2));
    last_ = nullptr;
    device_->unplug();
    ASSERT_TRUE(wait_until_lost(*camera));
    camera.reset();
    EXPECT_THROW(device_->open(), Error);
    device_->plug();
  }
  const auto camera = started();
  ASSERT_NO_FATAL_FAILURE(take(*camera, 2));
}

TEST_P(CameraCompliance, NamesTheDeviceThatIsMissing) {
  EXPECT_THAT(error_of([&] { device_->open_missing(); }), HasSubstr("missing"));
}

std::vector<RegisteredDevice> devices(bool with_a_cable) {
  std::vector<RegisteredDevice> devices;
  for (const RegisteredDevice& device : registered_devices())
    if (device.has_a_cable || !with_a_cable) devices.push_back(device);
  return devices;
}

std::string name_of(const testing::TestParamInfo<RegisteredDevice>& instance) {
  return instance.param.name;
}

INSTANTIATE_TEST_SUITE_P(Drivers, CameraCompliance, testing::ValuesIn(devices(false)), name_of);
INSTANTIATE_TEST_SUITE_P(Drivers, CameraUnplugged, testing::ValuesIn(devices(true)), name_of);

}  // namespace previz::test::camera_compliance_test
