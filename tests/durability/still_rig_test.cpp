// A rig whose disks stand still: pictures and buttons go on.
#include <nlohmann/json.hpp>

#include "daemon/rig/set_keeper.hpp"
#include "tests/durability/still_disk.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/notify_socket.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::still_rig_test {

using test::NotifySocket;
using test::RigLive;
using test::StillDisk;

// Lets the disk go on however a script ends, because the rig waits for it.
struct GoesOn {
  StillDisk& disk;
  ~GoesOn() { disk.go_on(); }
};

TEST_F(RigLive, ADiskThatStandsStillForASnapshotKeepsNoPictureWaiting) {
  write_set();
  std::filesystem::create_directories(directory_ / "live");
  StillDisk disk(directory_ / "live");
  run([&] {
    const GoesOn at_end{disk};
    until_samples(2);
    begin_take();
    disk.stand_still();
    constexpr std::uint64_t waiting = 4;
    for (std::uint64_t i = 1; i <= waiting + 3; ++i) {
      press("snapshot");
      const Shown now = until([&](const Shown& s) { return s.look.snapshots == i; });
      until([&](const Shown& s) { return s.count > now.count + 3; });
    }
    until_said("snapshot: is skipped");
    end_take();
  });
  const auto dropped = metrics_.stages.at("snapshot").dropped;
  ASSERT_TRUE(dropped.contains("queue full")) << log_.text();
  EXPECT_GE(dropped.at("queue full"), 1u);
  EXPECT_LE(dropped.at("queue full"), 2u);
  EXPECT_TRUE(session::open_session(take_folder()).missing.empty());
}

// The stages, the recorder and the main loop say what waits for them, and nothing does for long
// while the rig is well.
TEST_F(RigLive, EveryQueueIsMeasured) {
  write_set();
  run_rendering([&] {
    until_measured([](const nlohmann::json& stages) {
      return std::ranges::all_of(
          std::array{"tracking", "lighting", "render", "review", "display", "snapshot", "recorder",
                     "folders of takes", "main loop"},
          [&](const char* stage) {
            return stages.contains(stage) && stages.at(stage).at("waiting").at("oldest_s") < 10;
          });
    });
  });
}

// The takes' disk: the main loop, which answers buttons, the bus and the watchdog, asks it nothing.
TEST_F(RigLive, ADiskOfTakesThatStandsStillKeepsNoButtonWaiting) {
  write_set();
  std::filesystem::create_directories(directory_ / "takes");
  StillDisk disk(directory_ / "takes");
  run([&] {
    const GoesOn at_end{disk};
    until_samples(2);
    disk.stand_still();
    begin_take();
    until_said("its disk does not respond");
    until_measured([](const nlohmann::json& stages) {
      const nlohmann::json& waiting = stages.at("recorder").at("waiting");
      const nlohmann::json& folders = stages.at("folders of takes").at("waiting");
      return waiting.at("values") > 1 && waiting.at("oldest_s") > 0.1 && waiting.at("bytes") > 0 &&
             folders.at("oldest_s") > 0.1;
    });
    for (int times = 0; times < 2; ++times) {
      const Shown now = shown_now();
      press("refine");
      until_mode(live::Mode::refine);
      press("live");
      until_mode(live::Mode::live);
      until([&](const Shown& s) { return s.count > now.count + 2; });
    }
    disk.go_on();
    end_take();
  });
}

// A set that takes long to be read: the rig goes on with the set it has, answers, and changes when
// it is there.
TEST_F(RigLive, ASetThatTakesLongToBeReadHoldsUpNothing) {
  write_set();
  const std::filesystem::path file = directory_ / "set.toml";
  std::string other = test::content_of(file);
  const std::string good = other;
  other.replace(other.find("samples = 2"), 11, "samples = 4");
  // The disk does not stand still for this name of the file.
  const auto write = [&](const std::string& text) {
    std::ofstream(directory_ / "beside") << text;
    std::filesystem::rename(directory_ / "beside", directory_ / "." / "set.toml");
  };
  StillDisk disk(file);
  NotifySocket systemd(directory_ / "notify");
  run_rendering([&] {
    disk.stand_still();
    write(other);
    press("reload_set");
    until_said("button reload_set: reloading the set file");
    systemd.skip();
    EXPECT_GE(systemd.fed_within(std::chrono::seconds(2)), 3);
    press("samples_up");
    until_samples(3);
    press("next_set");
    until_said("button next_set: a set is already loading");
    disk.go_on();
    until_samples(4);

    // A take that begins meanwhile is not ended by a set.
    disk.stand_still();
    write(good);
    press("reload_set");
    begin_take();
    disk.go_on();
    until_said("the old set stays in use: recording began while another one was loading");
    const int before = shown_now().count;
    until([&](const Shown& s) { return s.count > before + 4 && s.look.state.recording; });
    end_take();
    until_samples(2);  // it is read now
  });
  EXPECT_TRUE(session::open_session(take_folder()).missing.empty());
}

// Nobody waits for a set whose disk does not respond: it is given up after a while, and a rig that
// ends meanwhile does so.
TEST(SetKeeperOnAStillDisk, ReadsOnAThreadOfItsOwnAndGivesUp) {
  const test::TemporaryDirectory folder;
  const std::filesystem::path file = folder / "sets/b.toml";
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << "set.name = \"old\"\n";
  std::ostringstream log;
  report::Reports reports(report::lines_to(log));
  StillDisk disk(file.parent_path());
  {
    SetKeeper sets(
        file, [](set::Set&) {}, reports, {}, std::chrono::milliseconds(0));
    disk.stand_still();
    EXPECT_FALSE(sets.look_at_file());
    sets.begin_change(0);
    EXPECT_TRUE(sets.is_reading());
    const std::optional<SetKeeper::Ended> ended = sets.finish(std::chrono::milliseconds(0));
    ASSERT_TRUE(ended && ended->why_not);
    EXPECT_THAT(*ended->why_not, HasSubstr("the disk does not respond"));
    EXPECT_FALSE(sets.is_reading());
    EXPECT_EQ(sets.running().set.name, "old");
    EXPECT_FALSE(sets.look_at_file());
  }
  disk.go_on();
  // The threads that were left end by themselves.
  ASSERT_TRUE(test::wait_until("nobody waits", [&] { return disk.waiting() == 0; }));
}

}  // namespace previz::rig::still_rig_test
