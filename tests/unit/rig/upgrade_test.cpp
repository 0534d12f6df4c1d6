// An upgrade while a take is being recorded: the rig goes on until the take has ended, and then
// ends by itself, so that the service starts the new version.
#include <unistd.h>

#include "daemon/core/session/session.hpp"
#include "daemon/rig/live.hpp"
#include "daemon/rig/service.hpp"
#include "tests/support/crewed_rig.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::upgrade_test {

TEST(Upgrade, WaitsForTheEndOfTheTake) {
  const test::PrivateBus bus;
  if (!bus.running()) GTEST_SKIP() << "dbus-daemon is not installed";
  const test::TemporaryDirectory directory;
  test::write_small_take(
      directory.path(), true,
      "[recording]\nslate = \"1\"\nreserve_mb = 1\n" + test::button_for_every_action());

  std::atomic<int> shown = 0, recorded = 0;
  std::atomic<bool> replaced = false, ended = false;
  std::stop_source stop;
  test::Hand hand;
  std::ostringstream out;
  report::Reports reports(report::lines_to(out));
  LiveOptions options;
  options.loop = options.bus = true;
  options.on_shown = [&](const pipeline::Shot&, const live::Look& look) {
    ++shown;
    if (look.state.recording) ++recorded;
  };
  options.replaced = [&] { return replaced.load(); };
  std::jthread crew([&] {
    const auto pictures = [&](const std::atomic<int>& count, int more) {
      const int before = count;
      EXPECT_TRUE(test::wait_until("pictures", [&] { return count >= before + more; }));
    };
    pictures(shown, 1);
    hand.press("record");
    pictures(recorded, 1);
    hand.press("record");  // a take that ends before the upgrade ends nothing
    pictures(shown, 3);
    hand.press("record");
    pictures(recorded, 1);
    replaced = true;
    hand.press("debug_view");  // whatever changes meanwhile ends no take
    pictures(recorded, 5);
    EXPECT_FALSE(ended);
    hand.press("record");
    EXPECT_TRUE(test::wait_until("the rig has ended", [&] { return ended.load(); }));
    stop.request_stop();
  });
  run_live(test::with_hand(options, directory.path(), hand, stop), reports);
  ended = true;
  EXPECT_FALSE(stop.stop_requested()) << "the rig was stopped by the test";
  EXPECT_THAT(out.str(), HasSubstr("another version was installed"));
  EXPECT_TRUE(session::open_session(directory / "takes/1_take002").missing.empty());
}

TEST(Upgrade, IsSeenByTheFileOfTheProgram) {
  EXPECT_FALSE(Service::program_was_replaced());
  const test::TemporaryDirectory directory;
  std::filesystem::create_symlink("/usr/bin/previzd", directory / "exe");
  EXPECT_FALSE(Service::program_was_replaced((directory / "exe").c_str()));
  std::filesystem::create_symlink("/usr/bin/previzd (deleted)", directory / "gone");
  EXPECT_TRUE(Service::program_was_replaced((directory / "gone").c_str()));
}

// What of /proc/devices a service may use is settled as it starts; proc(5) has the format.
TEST(Upgrade, AKindOfDevicesThatIsNewIsSeenByTheKernelsList) {
  EXPECT_THAT(Service::device_kinds(), HasSubstr(" mem\n"));
  const test::TemporaryDirectory directory;
  const std::string file = directory / "devices";
  const std::string kinds = "Character devices:\n  1 mem\n226 drm\n";
  std::ofstream(file) << kinds << "\nBlock devices:\n  7 loop\n";
  EXPECT_EQ(Service::device_kinds(file.c_str()), kinds);
  std::ofstream(file) << kinds << "\nBlock devices:\n  7 loop\n  8 sd\n";
  EXPECT_EQ(Service::device_kinds(file.c_str()), kinds) << "a disk is no kind of devices to open";
  EXPECT_EQ(Service::device_kinds((directory / "none").c_str()), "");
}

}  // namespace previz::rig::upgrade_test
