// A camera is unplugged and plugged in again a hundred times, and nothing may be left behind.
#include "drivers/lifeline.hpp"
#include "tests/devices/device_under_test.hpp"
#include "tests/devices/leftovers.hpp"
#include "tests/support/test.hpp"

namespace previz::test::replug_test {

using std::chrono::milliseconds;
using namespace std::chrono_literals;

constexpr int cycles = 100;
constexpr int warm_cycles = 20;  // until what is made once a process has been made
constexpr int last_cycles = 10;  // in which what stays is looked for

LifelineOptions impatient(milliseconds stall_timeout) {
  return {5000ms, stall_timeout, 0ms, {10ms, 40ms}};
}

class Replugging : public testing::TestWithParam<RegisteredDevice> {
 protected:
  void SetUp() override {
    std::string why_not = "no reason was given";
    device_ = GetParam().make(why_not);
    if (!device_) GTEST_SKIP() << why_not;
    if (!device_->why_no_cable().empty()) GTEST_SKIP() << device_->why_no_cable();
  }

  // Each frame must be of the opening it comes from.
  void take(Lifeline& lifeline, int count) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (count > 0) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << to_string(lifeline.state());
      const CameraEvent event = lifeline.next(50ms);
      const auto* frame = std::get_if<FramePtr>(&event);
      if (!frame) continue;
      ASSERT_EQ((*frame)->width, lifeline.format().width);
      ASSERT_EQ((*frame)->format, lifeline.format().format);
      --count;
    }
  }

  // Until the lifeline has closed the device that was pulled.
  void wait_for_loss(Lifeline& lifeline, std::uint64_t lost) {
    const auto end = std::chrono::steady_clock::now() + 20s;
    while (lifeline.counters().at("lost") < lost) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << to_string(lifeline.state());
      lifeline.next(50ms);
    }
  }

  std::unique_ptr<DeviceUnderTest> device_;
};

TEST_P(Replugging, AHundredTimesLeavesNothingBehind) {
  Lifeline lifeline(
      "device", [this] { return device_->open(); }, impatient(device_->stall_timeout()));
  lifeline.start();
  std::size_t descriptors = 0, bytes = 0;
  std::size_t bytes_after = std::numeric_limits<std::size_t>::max();  // in the last cycles
  for (int cycle = 0; cycle < cycles; ++cycle) {
    ASSERT_NO_FATAL_FAILURE(take(lifeline, 2));
    if (cycle == warm_cycles) descriptors = open_descriptors(), bytes = live_bytes();
    if (cycle >= cycles - last_cycles) bytes_after = std::min(bytes_after, live_bytes());
    device_->unplug();
    lifeline.next(0ms);
    device_->plug();
    ASSERT_NO_FATAL_FAILURE(wait_for_loss(lifeline, static_cast<std::uint64_t>(cycle) + 1));
  }
  ASSERT_NO_FATAL_FAILURE(take(lifeline, 2));
  EXPECT_EQ(open_descriptors(), descriptors);
  // malloc gives no less than 32 bytes: the smallest object left behind in each cycle is as much.
  // Three quarters of it leave room for 1920 bytes that differ once, as between two states of a
  // queue. On a busy machine more may wait in one at any moment (2016 were seen): of the last
  // cycles the one with the least tells what stays.
  const std::size_t least = std::max<std::size_t>(24, device_->kept_by_others());
  bytes_after = std::min(bytes_after, live_bytes());
  const std::size_t kept = bytes_after - std::min(bytes, bytes_after);
  RecordProperty("bytes_a_cycle", static_cast<int>(kept / (cycles - warm_cycles)));
  EXPECT_LT(kept, (cycles - warm_cycles) * least);
  EXPECT_GE(lifeline.counters().at("opened"), std::uint64_t{cycles} + 1);
}

std::vector<RegisteredDevice> devices_with_a_cable() {
  std::vector<RegisteredDevice> devices;
  for (const RegisteredDevice& device : registered_devices())
    if (device.has_a_cable) devices.push_back(device);
  return devices;
}

INSTANTIATE_TEST_SUITE_P(Drivers, Replugging, testing::ValuesIn(devices_with_a_cable()),
                         [](const auto& instance) { return std::string(instance.param.name); });

}  // namespace previz::test::replug_test
