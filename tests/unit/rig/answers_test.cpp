// What the rig answers on the bus comes after what it claims, and there is an answer at any time.
#include <systemd/sd-bus.h>

#include "daemon/control/bus.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::answers_test {

// Returns what the rig answers, after "refused: " if it is an error.
template <class... Arguments>
std::string answer(const char* interface, const char* method, const char* types,
                   Arguments... arguments) {
  sd_bus* client = nullptr;
  sd_bus_message* reply = nullptr;
  sd_bus_error error = SD_BUS_ERROR_NULL;
  std::string said = "no bus";
  if (sd_bus_open_system(&client) >= 0) {
    const int result = sd_bus_call_method(client, control::bus_name, control::object_path,
                                          interface, method, &error, &reply, types, arguments...);
    const char *text = "", *type = nullptr;
    if (result >= 0 && sd_bus_message_peek_type(reply, nullptr, &type) >= 0 && type)
      sd_bus_message_enter_container(reply, 'v', type);
    if (result >= 0) sd_bus_message_read(reply, "s", &text);
    said = result >= 0 ? text : std::string("refused: ") + (error.message ? error.message : "");
  }
  sd_bus_message_unref(reply);
  sd_bus_error_free(&error);
  sd_bus_flush_close_unref(client);
  return said;
}
std::string act(const char* action) {
  return answer(control::interface_name, "Action", "s", action);
}
std::string mode() {
  return answer("org.freedesktop.DBus.Properties", "Get", "ss", control::interface_name, "Mode");
}

class RigAnswers : public test::RigLive {
 protected:
  void SetUp() override {
    if (!bus_.running()) GTEST_SKIP() << "dbus-daemon is not installed";
    write_set();
    options_.bus = true;
  }
  test::PrivateBus bus_;
};

TEST_F(RigAnswers, ASnapshotNamesItsFile) {
  run_rendering([&] {
    test::must_come("the rig answers", [] { return mode() == "live"; });
    const std::string stem = directory_ / "live/snapshot_0001";
    EXPECT_EQ(act("snapshot"), stem + ".exr and .png");
    EXPECT_TRUE(std::filesystem::exists(stem + ".exr"));
    EXPECT_TRUE(std::filesystem::exists(stem + ".png"));
    EXPECT_TRUE(said("snapshot: " + stem + ".exr and .png"));
    EXPECT_EQ(act("standby"), "standby");
    EXPECT_EQ(act("snapshot"), "refused: standby shows no picture; nothing to save");
  });
}

TEST_F(RigAnswers, ASnapshotThatCannotBeWrittenIsRefusedWithTheReason) {
  run_rendering([&] {
    test::must_come("the rig answers", [] { return mode() == "live"; });
    std::filesystem::rename(directory_ / "live", directory_ / "gone");
    std::ofstream(directory_ / "live") << "a file where the directory was";
    const std::string refused = act("snapshot");
    EXPECT_EQ(refused.find("refused: " + (directory_ / "live").string()), 0u) << refused;
  });
}

// The take is on the disk, or the answer says how much of it is not.
TEST_F(RigAnswers, ATakeIsMarkedAtOnceAndReviewedOnceItIsWritten) {
  run_rendering([&] {
    test::must_come("the rig answers", [] { return mode() == "live"; });
    EXPECT_EQ(act("record"), "recording");
    until_more(8);
    EXPECT_EQ(act("mark_good"), "the running take is marked good when it is finished");
    EXPECT_EQ(act("record"), "recording ended");
    const std::string refused = act("review");
    EXPECT_EQ(refused.find("refused: 12A_take001 is still being written: "), 0u) << refused;
    const std::string marked = act("mark_good");
    EXPECT_THAT(marked, testing::AnyOf("12A_take001 is marked good when it is written",
                                       "marking 12A_take001 good"));
    until_said("take 12A_take001 is finished");
    EXPECT_EQ(act("review"), "review");
  });
  EXPECT_TRUE(session::open_session(take_folder()).info.take->good);
}

// The bus knows the rig from its start on, and each set that loads leaves it there.
TEST_F(RigAnswers, WhileASetLoadsItSaysSo) {
  std::atomic<bool> holds = true, has_begun = false;
  options_.around_cameras = [&](live::Cameras&) {
    has_begun = true;
    test::must_come("the set may go on", [&] { return !holds; });
  };
  run([&] {
    const auto see_loading = [&] {
      test::must_come("the set loads", [&] { return has_begun.load(); });
      test::must_come("the rig is on the bus", [] { return mode() == "loading"; });
      const std::string refused = act("record");
      EXPECT_EQ(refused.find("refused: a set is loading (since "), 0u) << refused;
      holds = false;
      test::must_come("it runs", [] { return mode() == "live"; });
    };
    see_loading();
    until_samples(2);
    has_begun = false;
    holds = true;
    EXPECT_EQ(act("reload_set"), "reloading the set file");
    see_loading();
  });
}

}  // namespace previz::rig::answers_test
