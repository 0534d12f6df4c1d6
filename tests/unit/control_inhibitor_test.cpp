// The lock that holds off a shutdown, of a logind that the test plays on a bus of its own.
#include "daemon/control/inhibitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <systemd/sd-bus.h>
#include <systemd/sd-event.h>
#include <unistd.h>

#include <poll.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/support/private_bus.hpp"

namespace previz::control {
namespace control_inhibitor_test {

using testing::ElementsAre;
using testing::HasSubstr;

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
    for (const int end : {ends_[0], ends_[1]})
      if (end >= 0) close(end);
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
    if (test.refuses_)
      return sd_bus_reply_method_errorf(call, SD_BUS_ERROR_ACCESS_DENIED, "Permission denied");
    if (pipe(test.ends_) != 0) return -errno;
    const int result = sd_bus_reply_method_return(call, "h", test.ends_[1]);
    close(std::exchange(test.ends_[1], -1));
    return result;
  }
  // Runs the loop until the condition holds, or five seconds have passed.
  bool runs_until(const std::function<bool()>& condition) {
    for (int i = 0; i < 500 && !condition(); ++i) sd_event_run(loop_, 10'000);
    return condition();
  }
  // Returns whether somebody holds the other end of the pipe, as logind looks for it.
  bool is_locked() const {
    pollfd end{ends_[0], POLLIN, 0};
    return ends_[0] >= 0 && (poll(&end, 1, 0) == 0 || (end.revents & POLLHUP) == 0);
  }

  test::PrivateBus bus_;
  sd_event* loop_ = nullptr;
  sd_bus* logind_ = nullptr;
  bool refuses_ = false;
  int ends_[2] = {-1, -1};
  std::vector<std::string> asked_, troubles_;
  std::optional<Inhibitor> inhibitor_;
};

TEST_F(InhibitorTest, HoldsOffShutdownAndSleepUntilItIsGivenBack) {
  start_logind(false);
  inhibitor_->hold(true);
  inhibitor_->hold(true);  // while the first is not answered yet
  EXPECT_TRUE(runs_until([&] { return inhibitor_->is_held(); }));
  inhibitor_->hold(true);
  EXPECT_TRUE(is_locked());
  EXPECT_THAT(asked_, ElementsAre("shutdown:sleep previzd block"));
  inhibitor_->hold(false);
  EXPECT_TRUE(runs_until([&] { return !is_locked(); }));
  EXPECT_FALSE(inhibitor_->is_held());
  EXPECT_THAT(troubles_, ElementsAre());
}

TEST_F(InhibitorTest, ATakeThatEndsBeforeTheAnswerLeavesNoLock) {
  start_logind(false);
  inhibitor_->hold(true);
  inhibitor_->hold(false);
  EXPECT_TRUE(runs_until([&] { return !asked_.empty(); }));
  EXPECT_TRUE(runs_until([&] { return !is_locked(); }));
  EXPECT_FALSE(inhibitor_->is_held());
}

TEST_F(InhibitorTest, ARefusalIsSaidAndDoesNoHarm) {
  start_logind(true);
  inhibitor_->hold(true);
  EXPECT_TRUE(runs_until([&] { return !troubles_.empty(); }));
  EXPECT_THAT(troubles_, ElementsAre(HasSubstr("Permission denied")));
  EXPECT_FALSE(inhibitor_->is_held());
  refuses_ = false;
  inhibitor_->hold(true);  // of the next take
  EXPECT_TRUE(runs_until([&] { return inhibitor_->is_held(); }));
}

TEST_F(InhibitorTest, AMachineWithoutLogindOrBusIsSaid) {
  inhibitor_->hold(true);
  EXPECT_TRUE(runs_until([&] { return !troubles_.empty(); }));
  setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nonexistent/bus", 1);
  Inhibitor without_bus(loop_, [this](const std::string& what) { troubles_.push_back(what); });
  without_bus.hold(true);
  EXPECT_TRUE(runs_until([&] { return troubles_.size() == 2; }));
}

}  // namespace control_inhibitor_test
}  // namespace previz::control
