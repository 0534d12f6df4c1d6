// The lock that holds off a shutdown, of a logind that the test plays on a bus of its own.
#include "daemon/control/inhibitor.hpp"

#include <systemd/sd-bus.h>
#include <systemd/sd-event.h>
#include <unistd.h>

#include <poll.h>

#include "tests/support/private_bus.hpp"
#include "tests/support/test.hpp"

namespace previz::control::inhibitor_test {

// Inhibitor and logind are on one loop, in one thread.
class InhibitorTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!bus_.running()) GTEST_SKIP() << "dbus-daemon is not installed";
    ASSERT_GE(sd_event_new(&loop_), 0);
    inhibitor_.emplace(loop_, [this](const std::string& what) { troubles_.push_back(what); });
  }
  void TearDown() override {
    inhibitor_.reset();
    for (const int end : ends_) close(end);
    if (logind_) sd_bus_detach_event(logind_);
    sd_bus_flush_close_unref(logind_);
    sd_event_unref(loop_);
  }
  void start_logind(bool refuses) {
    refuses_ = refuses;
    static const sd_bus_vtable table[] = {
        SD_BUS_VTABLE_START(0),
        SD_BUS_METHOD("Inhibit", "ssss", "h", on_inhibit, SD_BUS_VTABLE_UNPRIVILEGED),
        SD_BUS_VTABLE_END};
    ASSERT_GE(sd_bus_open_system(&logind_), 0);
    ASSERT_GE(sd_bus_add_object_vtable(logind_, nullptr, "/org/freedesktop/login1",
                                       "org.freedesktop.login1.Manager", table, this),
              0);
    ASSERT_GE(sd_bus_request_name(logind_, "org.freedesktop.login1", 0), 0);
    ASSERT_GE(sd_bus_attach_event(logind_, loop_, 0), 0);
  }
  static int on_inhibit(sd_bus_message* call, void* self, sd_bus_error*) {
    auto& test = *static_cast<InhibitorTest*>(self);
    const char *what = nullptr, *who = nullptr, *why = nullptr, *mode = nullptr;
    sd_bus_message_read(call, "ssss", &what, &who, &why, &mode);
    test.asked_.push_back(std::string(what) + " " + who + " " + mode);
    // As logind does, which asks polkit about another lock where more than one is wanted.
    const bool is_one = std::string(what).find(':') == std::string::npos;
    if (test.refuses_ || !is_one)
      return sd_bus_reply_method_errorf(call, SD_BUS_ERROR_ACCESS_DENIED, "Permission denied");
    int ends[2];
    if (pipe(ends) != 0) return -errno;
    test.ends_.push_back(ends[0]);
    const int result = sd_bus_reply_method_return(call, "h", ends[1]);
    close(ends[1]);
    return result;
  }
  // Runs the loop until the condition holds, or five seconds have passed.
  bool runs_until(const std::function<bool()>& condition) {
    for (int i = 0; i < 500 && !condition(); ++i) sd_event_run(loop_, 10'000);
    return condition();
  }
  // Returns how many pipes somebody holds the other end of, as logind looks for it.
  std::size_t locks() const {
    return static_cast<std::size_t>(std::ranges::count_if(ends_, [](int read_end) {
      pollfd end{read_end, POLLIN, 0};
      return poll(&end, 1, 0) == 0 || (end.revents & POLLHUP) == 0;
    }));
  }

  test::PrivateBus bus_;
  sd_event* loop_ = nullptr;
  sd_bus* logind_ = nullptr;
  bool refuses_ = false;
  std::vector<int> ends_;
  std::vector<std::string> asked_, troubles_;
  std::optional<Inhibitor> inhibitor_;
};

TEST_F(InhibitorTest, HoldsOffShutdownAndSleepUntilItIsGivenBack) {
  start_logind(false);
  inhibitor_->hold(true);
  inhibitor_->hold(true);  // while the first is not answered yet
  EXPECT_TRUE(runs_until([&] { return inhibitor_->is_held(); }));
  inhibitor_->hold(true);
  EXPECT_EQ(locks(), 2u);
  EXPECT_THAT(asked_, ElementsAre("shutdown previzd block", "sleep previzd block"));
  inhibitor_->hold(false);
  EXPECT_TRUE(runs_until([&] { return locks() == 0; }));
  EXPECT_FALSE(inhibitor_->is_held());
  EXPECT_THAT(troubles_, ElementsAre());
}

TEST_F(InhibitorTest, ATakeThatEndsBeforeTheAnswerLeavesNoLock) {
  start_logind(false);
  inhibitor_->hold(true);
  inhibitor_->hold(false);
  EXPECT_TRUE(runs_until([&] { return asked_.size() == 2; }));
  EXPECT_TRUE(runs_until([&] { return locks() == 0; }));
  EXPECT_FALSE(inhibitor_->is_held());
}

TEST_F(InhibitorTest, ARefusalIsSaidAndDoesNoHarm) {
  start_logind(true);
  inhibitor_->hold(true);
  EXPECT_TRUE(runs_until([&] { return troubles_.size() == 2; }));
  EXPECT_THAT(
      troubles_,
      ElementsAre(
          "the machine may be shut down while a take is being recorded: Permission denied",
          "the machine may be put to sleep while a take is being recorded: Permission denied"));
  EXPECT_FALSE(inhibitor_->is_held());
  refuses_ = false;
  inhibitor_->hold(true);  // of the next take
  EXPECT_TRUE(runs_until([&] { return inhibitor_->is_held(); }));
}

TEST_F(InhibitorTest, AMachineWithoutLogindOrBusIsSaid) {
  inhibitor_->hold(true);
  EXPECT_TRUE(runs_until([&] { return troubles_.size() == 2; }));
  setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nonexistent/bus", 1);
  Inhibitor without_bus(loop_, [this](const std::string& what) { troubles_.push_back(what); });
  without_bus.hold(true);
  EXPECT_TRUE(runs_until([&] { return troubles_.size() == 4; }));
}

}  // namespace previz::control::inhibitor_test
