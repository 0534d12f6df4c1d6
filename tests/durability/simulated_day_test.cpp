// A day of the whole rig in simulated time: the crew records a take in every hour, and each hour
// has its own mishap.
#include <iostream>

#include "daemon/core/check/check.hpp"
#include "daemon/core/output/take_writer.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/rig/live.hpp"
#include "drivers/lifeline.hpp"
#include "tests/durability/simulated_time.hpp"
#include "tests/durability/simulated_time_camera.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/crewed_rig.hpp"
#include "tests/support/notify_socket.hpp"
#include "tests/support/other_camera.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::rig::simulated_day_test {

using test::SimulatedDevice;
using test::SimulatedTime;
using test::Stamps;

constexpr std::int64_t ms = 1'000'000, second = 1000 * ms, hour = 3600 * second;
constexpr std::int64_t midnight = 1'798'675'200 * second;  // CLOCK_REALTIME: 2026-12-31 00:00 UTC

enum class Mishap {
  none,
  step_forward,
  step_back,
  drift,
  suspension,
  jitter,
  short_stall,
  stall,
  long_stall,
  loss,
  hang,
};
constexpr int mishaps = 11, takes = 3 * mishaps;  // each with each kind of stamps

// A computer that saves power while no camera is there lets waits end late by so much.
constexpr std::int64_t quiet_grain = 4 * second;
// The rig takes so long for what it does at a time: looks at clocks, and a wait that is rounded to
// milliseconds.
constexpr std::int64_t work = 5 * ms;

class SimulatedDay : public testing::Test {
 protected:
  struct Said {
    std::int64_t at_ns;
    std::string line;
  };
  struct Recorded {
    std::int64_t begin_ns, end_ns;  // when the rig said so
  };

  SimulatedDay() {
    ::setenv("TZ", "UTC", 1);
    ::setenv("STATE_DIRECTORY", directory_.path().c_str(), 1);
    // The rig had a GPU, so that it waits for it and shows plates; there is none.
    std::ofstream(directory_ / "graphics-device") << "a GPU\n";
    ::setenv("VK_DRIVER_FILES", "/nonexistent", 1);
    ::setenv("VK_ICD_FILENAMES", "/nonexistent", 1);
    test::write_small_take(
        directory_.path(), true,
        "[[light]]\nname = \"key\"\ntype = \"point\"\n"
        "position_m = [0.3, 0, 0.6]\nemission = [1, 1, 1]\n"
        "[lighting]\nfrom = \"set\"\n[recording]\nslate = \"12A\"\nreserve_mb = 1\n"
        "directory = \"takes\"\n" +
            test::button_for_every_action());
    std::string text = test::content_of(directory_ / "set.toml");
    const std::string before = "[light_camera]\ndriver = \"replay\"\ndevice = \"session\"\n";
    text.replace(text.find(before), before.size(), "[light_camera]\ndriver = \"none\"\n");
    std::ofstream(directory_ / "set.toml") << text;
  }
  ~SimulatedDay() override {
    for (const char* name : {"STATE_DIRECTORY", "VK_DRIVER_FILES", "VK_ICD_FILENAMES"})
      ::unsetenv(name);
  }

  // Runs the rig until the crew's script has ended.
  void run(const std::function<void()>& script) {
    LiveOptions options;
    options.around_cameras = [this](live::Cameras& cameras) {
      cameras.observer = std::make_unique<Lifeline>("simulated", [this] { return device_.open(); });
      cameras.observer->start();
      cameras.clock_offset_ns = 0;
      test::put_around(cameras.observer, [this](CameraEvent event, Camera&) {
        look_at(event);
        return event;
      });
    };
    options.on_shown = [this](const pipeline::Shot& shot, const live::Look& look) {
      look_at(shot, look);
    };
    metrics_ = test::run_crewed(std::move(options), directory_.path(), hand_, script, reports_);
  }

  // ---- what is checked at every event

  void look_at(const CameraEvent& event) {
    if (const auto* frame = std::get_if<FramePtr>(&event)) return look_at(**frame);
    const auto* trouble = std::get_if<DeviceTrouble>(&event);
    if (!trouble) return;
    SCOPED_TRACE(trouble->what);
    const std::int64_t now = time_.now_ns();
    const auto comes_after = [&](std::int64_t wait, std::int64_t since) {
      EXPECT_GE(now - since, wait);
      EXPECT_TRUE(is_hung_ || now - since <= wait + work) << (now - since) / ms;
    };
    const auto is = [&](const char* words) { return trouble->what.starts_with(words); };
    if (is("has sent nothing for 2000 ms"))
      comes_after(2 * second, last_delivery_ns_);
    else if (is("is stalled"))
      comes_after(3 * second, last_delivery_ns_);
    else if (is("sends no frame within 5000 ms"))
      comes_after(5 * second, device_.opened_ns());
    else if (is("was unplugged"))
      EXPECT_LE(now - unplugged_ns_, SimulatedDevice::interval_ns + 100 * ms);
    else
      EXPECT_TRUE(is("simulated: is not there")) << "nothing of the kind has happened";
    ++troubles_[trouble->what.substr(0, trouble->what.find(';'))];
  }

  void look_at(const Frame& frame) {
    ++delivered_;
    EXPECT_GT(frame.timestamp_ns, last_stamp_ns_);
    EXPECT_GT(frame.sequence, last_sequence_);
    EXPECT_LE(frame.timestamp_ns, frame.arrival_ns);
    EXPECT_LE(frame.arrival_ns, time_.now_ns());
    last_stamp_ns_ = frame.timestamp_ns;
    last_sequence_ = frame.sequence;
    last_delivery_ns_ = time_.now_ns();
    const SimulatedDevice::Sent sent = device_.sent(frame.timestamp_ns);
    EXPECT_GE(frame.timestamp_ns, sent.captured_ns - earliest(sent.stamps));
    EXPECT_LE(frame.timestamp_ns, sent.captured_ns + latest(sent.stamps));
    if (sent.stamps != Stamps::own_clock || !sent.is_settled) return;
    ++settled_;
    EXPECT_NEAR(double(frame.timestamp_ns - sent.captured_ns - SimulatedDevice::least_delay_ns), 0,
                settled_error_ns);
  }

  // The least delays of the seconds of half a minute are each the least of 24 draws from 8 ms, a
  // third of a millisecond on average, and the line lies under them: a millisecond is three of
  // these.
  static constexpr double settled_error_ns = 1e6;

  // A stamp of the kernel is that of the exposure; OtherClock knows its clock to a microsecond. The
  // line of least delay lies under the arrivals of the last half minute, in which the camera's
  // clock drifts by at most 200 ppm, less the least delay that nobody can know.
  static std::int64_t earliest(Stamps stamps) {
    if (stamps == Stamps::own_clock) return 30 * second / 5000 - SimulatedDevice::least_delay_ns;
    return stamps == Stamps::monotonic ? 0 : ms / 1000;
  }
  // The first frames of a map are late by what the first arrival was. A frame that was stamped
  // before the computer was suspended has its arrival.
  std::int64_t latest(Stamps stamps) const {
    const std::int64_t arrival = SimulatedDevice::least_delay_ns + jitter_ns_ + work;
    return stamps == Stamps::own_clock || is_suspended_ ? arrival : earliest(stamps);
  }

  void look_at(const pipeline::Shot& shot, const live::Look& look) {
    const std::int64_t arrived = shot.arrived.time_since_epoch().count();
    EXPECT_GT(shot.frame->timestamp_ns, shown_stamp_ns_);
    EXPECT_LE(time_.now_ns() - arrived, 20 * ms) << "something waits on the way to the display";
    shown_stamp_ns_ = shot.frame->timestamp_ns;
    is_lost_ = look.state.camera_lost;
  }

  void look_at(const report::Report& report) {
    const std::lock_guard lock(mutex_);
    said_.push_back({time_.now_ns(), report::line_of(report)});
  }

  // ---- the crew

  void wait(std::int64_t for_ns) const { time_.sleep_exactly_until(time_.now_ns() + for_ns); }
  std::size_t lines() const {
    const std::lock_guard lock(mutex_);
    return said_.size();
  }
  std::string text() const {
    const std::lock_guard lock(mutex_);
    std::string all;
    for (const Said& said : said_)
      all += std::to_string(said.at_ns / ms) + " ms " + said.line + "\n";
    return all;
  }
  // Returns when a line with these words was said, after so many lines.
  std::optional<std::int64_t> when_said(const std::string& words, std::size_t after) const {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = after; i < said_.size(); ++i)
      if (said_[i].line.find(words) != std::string::npos) return said_[i].at_ns;
    return std::nullopt;
  }
  std::int64_t until_said(const std::string& words, std::size_t after) {
    std::optional<std::int64_t> when;
    test::must_come(
        "\"" + words + "\" is said", [&] { return (when = when_said(words, after)).has_value(); },
        [&] { return text(); });
    return *when;
  }
  std::int64_t press(const std::string& button, const std::string& answer) {
    const std::size_t before = lines();
    const std::int64_t at = time_.now_ns();
    hand_.press(button);
    const std::int64_t answered = until_said(answer, before);
    EXPECT_LE(answered - at, work) << "a button waits";
    return answered;
  }
  void until_frame(std::int64_t longest_ns) {
    const std::int64_t from = time_.now_ns();
    test::must_come(
        "a frame comes", [&] { return last_delivery_ns_ > from; }, [&] { return text(); });
    EXPECT_LE(last_delivery_ns_ - from, longest_ns);
  }
  bool is_trouble_shown() {
    return std::ranges::any_of(reports_.troubles(), [](const report::Notice& notice) {
      return notice.source == "film camera";
    });
  }

  void plug(Stamps stamps, double drift_ppm) {
    time_.coalesce_waits(1);
    device_.plug(stamps, drift_ppm);
    // The longest wait between two attempts, which may have been coalesced, and the first frame.
    until_frame(4 * second + quiet_grain + SimulatedDevice::interval_ns + jitter_ns_ + 10 * ms);
  }
  void unplug() {
    unplugged_ns_ = time_.now_ns();
    device_.unplug();
  }
  // The trouble ends with the first frame, and leaves the display once there was time to read it.
  void expect_well() {
    wait(4 * second + 200 * ms);
    EXPECT_FALSE(is_trouble_shown()) << text();
    EXPECT_FALSE(is_lost_);
  }
  void expect_trouble() { EXPECT_TRUE(is_trouble_shown()) << text(); }
  // The rig asks the camera every 100 ms, and reports a silence of two seconds.
  void expect_loss(std::size_t after) {
    const std::int64_t silent_ns = until_said("rig: camera lost", after) - last_delivery_ns_;
    EXPECT_GE(silent_ns, 2 * second);
    EXPECT_LE(silent_ns, 2 * second + 100 * ms + work);
    expect_trouble();
  }
  void expect_return(std::size_t after) {
    EXPECT_TRUE(when_said("rig: camera is back", after)) << text();
    expect_well();
  }

  // Records a take in which something happens.
  void record(const std::function<void()>& happens) {
    Recorded take{};
    const std::size_t before = lines();
    take.begin_ns = press("record", "button record: recording");
    wait(2 * second);
    happens();
    wait(2 * second);
    take.end_ns = press("record", "button record: recording ended");
    const std::int64_t finished = until_said("is finished", before);
    EXPECT_LE(finished - take.end_ns, 2 * second);
    takes_.push_back(take);
  }

  // What somebody or something does to the clocks while no take is recorded.
  void set_clocks(int take) {
    if (take % 4 == 1) time_.step_wall_clock(take % 8 == 1 ? -10 * second : 10 * second);
    if (take < takes - 1) return;
    constexpr std::int64_t day_s = 24 * 3600;
    const std::int64_t left = day_s * second - time_.wall_ns() % (day_s * second);
    time_.step_wall_clock(left - second);
    wait(second);
    time_.insert_leap_second();
  }

  void befall(Mishap mishap) {
    const std::size_t before = lines();
    const std::int64_t now = time_.now_ns();
    switch (mishap) {
      case Mishap::none:
        return;
      case Mishap::step_forward:
        return time_.step_wall_clock(10 * second);
      case Mishap::step_back:
        return time_.step_wall_clock(-10 * second);
      case Mishap::drift:
        device_.drift(-100);
        return wait(40 * second);
      case Mishap::suspension:
        return be_suspended();
      case Mishap::jitter:
        return be_busy();
      case Mishap::short_stall:  // shorter than a camera may be silent
        device_.stall_until(now + 1500 * ms);
        return wait(2 * second);
      case Mishap::stall:
        device_.stall_until(now + 3500 * ms);
        expect_loss(before);
        wait(1800 * ms);
        return expect_return(before);
      case Mishap::long_stall:
        device_.stall_until(now + 90 * second);
        expect_loss(before);
        wait(50 * second);
        expect_trouble();
        wait(50 * second);
        return expect_return(before);
      case Mishap::loss:
        unplug();
        expect_loss(before);
        wait(5 * second);
        plug(Stamps::own_clock, 50);
        return expect_return(before);
      case Mishap::hang:
        return hang(before);
    }
  }

  void be_suspended() {
    is_suspended_ = true;
    time_.suspend(600 * second);
    wait(second);
    is_suspended_ = false;
  }

  void be_busy() {
    device_.jitter(jitter_ns_ = 60 * ms);
    wait(5 * second);
    device_.jitter(8 * ms);
    wait(second);
    jitter_ns_ = 8 * ms;
  }

  // A driver may take two minutes (Patience::camera). Then the watchdog starves; systemd would
  // start the rig again.
  void hang(std::size_t before) {
    const std::int64_t begin = time_.now_ns(), end = begin + 130 * second;
    is_hung_ = true;
    hangs_.push_back({begin, end});
    device_.hang_until(end);
    wait(119 * second);
    const std::int64_t after = until_said("stopped responding: observer", before) - begin;
    EXPECT_GE(after, 120 * second);
    EXPECT_LE(after, 125 * second + 100 * ms);
    time_.sleep_exactly_until(end);
    until_frame(second);
    is_hung_ = false;
    expect_return(before);
  }

  // ---- what is checked in the evening

  void expect_take(std::size_t index, const std::map<std::int64_t, SimulatedDevice::Sent>& sent) {
    const std::filesystem::path folder =
        directory_ / "takes" / output::take_name("12A", static_cast<int>(index) + 1);
    SCOPED_TRACE(folder.string());
    session::Session take = session::open_session(folder);
    EXPECT_TRUE(take.missing.empty());
    std::ostringstream said;
    EXPECT_EQ(check::check_set({folder}, said), 0) << said.str();
    const auto stream = session::open_stream(take, "observer");
    ASSERT_TRUE(stream && take.info.take);
    const Recorded& recorded = takes_[index];
    std::set<std::int64_t> stamps;
    for (const session::FrameRecord& record : stream->records()) {
      ASSERT_TRUE(sent.contains(record.timestamp_ns));
      EXPECT_EQ(record.arrival_ns, sent.at(record.timestamp_ns).arrival_ns);
      EXPECT_TRUE(stamps.empty() || record.timestamp_ns > *stamps.rbegin());
      stamps.insert(record.timestamp_ns);
      // The time before the button is two seconds.
      EXPECT_GE(record.arrival_ns, recorded.begin_ns - 2 * second - 100 * ms);
      EXPECT_LE(record.arrival_ns, recorded.end_ns);
    }
    ASSERT_FALSE(stamps.empty());
    for (const auto& [stamp, frame] : sent)
      if (frame.arrival_ns > *stamps.begin() && frame.arrival_ns < recorded.end_ns - work &&
          stamp > *stamps.begin()) {
        EXPECT_TRUE(stamps.contains(stamp)) << "a frame is missing, of " << frame.arrival_ns;
      }
    EXPECT_LT(sent.at(*stamps.begin()).arrival_ns, recorded.begin_ns - 2 * second + 150 * ms);
    expect_timecode(*take.info.take, sent.at(*stamps.begin()).wall_ns);
  }

  // The timecode is the time of day at the first frame.
  static void expect_timecode(const session::TakeInfo& take, std::int64_t wall_ns) {
    const auto at = [&](std::int64_t ns) {
      return output::timecode_of(
          std::chrono::system_clock::time_point(std::chrono::nanoseconds(ns)), take.timecode_fps);
    };
    EXPECT_TRUE(take.timecode == at(wall_ns) || take.timecode == at(wall_ns + work))
        << take.timecode << " instead of " << at(wall_ns);
  }

  // Each kind of stamps had a stall, a long one and a hang, which are as many silences; a loss, and
  // the end of every take's hour.
  void expect_troubles() {
    EXPECT_EQ(troubles_["has sent nothing for 2000 ms"], 9);
    EXPECT_EQ(troubles_["is stalled"], 9);
    EXPECT_EQ(troubles_["was unplugged"], takes + 3);
    EXPECT_GE(troubles_["sends no frame within 5000 ms of its start"], 3);
  }

  // The watchdog is fed at least every ten seconds, half of its time, but for the hang.
  void expect_fed(const std::vector<std::int64_t>& fed, std::int64_t begin_ns,
                  std::int64_t end_ns) const {
    std::int64_t last = begin_ns;
    std::size_t starved = 0;
    for (const std::int64_t at : fed) {
      const bool is_hang = std::ranges::any_of(
          hangs_, [&](const Recorded& hang) { return last > hang.begin_ns && last < hang.end_ns; });
      const bool starves = at - last > 10 * second;
      EXPECT_TRUE(!starves || is_hang) << "not fed for " << (at - last) / ms << " ms";
      starved += starves ? 1u : 0u;
      last = at;
    }
    EXPECT_GE(last, end_ns - 10 * second);
    EXPECT_EQ(starved, hangs_.size());
  }

  SimulatedTime time_{midnight};
  const test::TemporaryDirectory directory_;
  test::Hand hand_;
  SimulatedDevice device_{time_, 38};
  report::Reports reports_{[this](const report::Report& report) { look_at(report); }};
  pipeline::MetricsSnapshot metrics_;
  std::vector<Recorded> takes_;
  std::map<std::string, int> troubles_;  // on the observer's thread
  std::atomic<std::uint64_t> delivered_ = 0, settled_ = 0;
  std::int64_t last_stamp_ns_ = 0;
  std::uint64_t last_sequence_ = 0;
  std::atomic<std::int64_t> last_delivery_ns_ = 0, unplugged_ns_ = 0, jitter_ns_ = 8 * ms;
  std::atomic<bool> is_lost_ = false, is_suspended_ = false, is_hung_ = false;
  std::int64_t shown_stamp_ns_ = 0;  // on the display's thread
  std::vector<Recorded> hangs_;
  mutable std::mutex mutex_;
  std::vector<Said> said_;
};

TEST_F(SimulatedDay, HasEveryTakeWholeAndEveryAlarmInTime) {
  std::vector<std::int64_t> fed_ns;
  std::optional<test::NotifySocket> systemd;
  systemd.emplace(directory_ / "notify", std::chrono::seconds(20),  // as previzd.service has it
                  [&](const std::string& message) {
                    if (message.find("WATCHDOG=1") != std::string::npos)
                      fed_ns.push_back(time_.now_ns());
                  });
  const std::int64_t begin = time_.now_ns();
  run([&] {
    for (int i = 0; i < takes; ++i) {
      SCOPED_TRACE("take " + std::to_string(i + 1));
      plug(static_cast<Stamps>(i / mishaps), 100.0 - 50 * (i % 5));
      wait(second);
      set_clocks(i);
      wait(3 * second);
      expect_well();
      if (i % 4 == 3) time_.step_wall_clock(10 * second);  // in the time before the button
      wait(second);
      record([&] { befall(static_cast<Mishap>(i % mishaps)); });
      const std::size_t before = lines();
      unplug();
      wait(200 * ms);
      expect_trouble();
      expect_loss(before);
      time_.coalesce_waits(quiet_grain);
      time_.sleep_exactly_until(begin + (i + 1) * 24 * hour / takes);
    }
  });
  systemd.reset();
  expect_fed(fed_ns, begin, begin + 24 * hour);

  EXPECT_EQ(metrics_.stages.at("observer").frames, delivered_);
  EXPECT_EQ(test::accounted_for(metrics_), delivered_) << to_json(metrics_);
  EXPECT_EQ(metrics_.stages.at("observer").dropped["by the device"], device_.dropped());
  EXPECT_FALSE(metrics_.stages.contains("recorder") &&
               !metrics_.stages.at("recorder").dropped.empty())
      << to_json(metrics_);
  const auto sent = device_.sent();
  EXPECT_EQ(takes_.size(), std::size_t{takes});
  for (std::size_t i = 0; i < takes_.size(); ++i) expect_take(i, sent);
  EXPECT_GT(settled_, 100u);
  expect_troubles();
  if (HasFailure()) std::cout << text();
  std::cout << delivered_ << " frames, " << time_.jumps() << " jumps of the clock\n";
}

}  // namespace previz::rig::simulated_day_test
