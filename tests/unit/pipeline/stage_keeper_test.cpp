// A part that fails, and a thread that hangs, without a pipeline around them and in a time that is
// made up.
#include "daemon/core/pipeline/stage_keeper.hpp"

#include "tests/support/test.hpp"

namespace previz::pipeline::stage_keeper_test {

using std::chrono::milliseconds;

class StageKeeperTest : public testing::Test {
 protected:
  StageKeeper keeper(std::function<void()> begin_anew = {}) {
    return {"render",
            {.reports = reports_,
             .metrics = metrics_,
             .liveness = liveness_,
             .patience = {.stage = milliseconds(1000)},
             .delays = {milliseconds(250), milliseconds(1000)},
             .clock = clock_},
            &Patience::stage,
            std::move(begin_anew)};
  }
  std::uint64_t count_of(const std::string& event) const {
    const auto counts = metrics_.snapshot(1).counts;
    return counts.contains(event) ? counts.at(event) : 0;
  }
  static void fail() { throw std::runtime_error("lamp fell down"); }

  HostClock::Time now_{std::chrono::hours(1)};
  HostClock clock_{[this] { return now_; }, [this](HostClock::Time time) { now_ = time; }};
  std::ostringstream log_;
  report::Reports reports_{report::lines_to(log_)};
  Metrics metrics_;
  Liveness liveness_{clock_};
};

TEST_F(StageKeeperTest, AFailureIsReportedShownAndCountedUntilThePartWorksAgain) {
  int begun_anew = 0;
  StageKeeper keeper = this->keeper([&] { ++begun_anew; });
  EXPECT_TRUE(keeper.attempt([] {}));
  EXPECT_EQ(log_.str(), "");
  EXPECT_FALSE(keeper.attempt(fail));
  EXPECT_EQ(log_.str(),
            "render: has failed and is restarting; recording continues: lamp fell down\n");
  EXPECT_EQ(reports_.announced() + "\n", log_.str());  // what the bus says
  ASSERT_EQ(reports_.troubles().size(), 1u);
  EXPECT_EQ(line_of(reports_.troubles()[0]),
            "render: has failed and is restarting: lamp fell down");
  EXPECT_TRUE(reports_.troubles()[0].lasts);
  EXPECT_EQ(count_of("render: failed"), 1u);
  EXPECT_EQ(begun_anew, 0);

  now_ += milliseconds(250);
  bool has_worked = false;
  EXPECT_TRUE(keeper.attempt([&] { has_worked = true; }));
  EXPECT_TRUE(has_worked);
  EXPECT_EQ(begun_anew, 1);
  EXPECT_FALSE(reports_.troubles()[0].lasts);
  EXPECT_EQ(count_of("render: restarted"), 1u);
  EXPECT_TRUE(keeper.attempt([] {}));
  EXPECT_EQ(begun_anew, 1);
}

TEST_F(StageKeeperTest, RestsLongerWithEveryFailureEvenIfItWorksInBetween) {
  StageKeeper keeper = this->keeper();
  bool is_asked = false;
  for (const int rest_ms : {250, 500, 1000, 1000}) {
    EXPECT_FALSE(keeper.attempt(fail));
    now_ += milliseconds(rest_ms - 1);
    EXPECT_FALSE(keeper.attempt([&] { is_asked = true; })) << rest_ms;
    EXPECT_FALSE(is_asked);
    now_ += milliseconds(1);
    EXPECT_TRUE(keeper.attempt([] {})) << rest_ms;
  }
  EXPECT_EQ(count_of("render: failed"), 4u);
  now_ += milliseconds(2001);  // twice the longest rest without a failure
  EXPECT_TRUE(keeper.attempt([] {}));
  EXPECT_FALSE(keeper.attempt(fail));
  now_ += milliseconds(250);
  EXPECT_TRUE(keeper.attempt([] {}));
}

TEST_F(StageKeeperTest, WhatCannotBeBegunAnewIsTriedAgain) {
  int refusals = 2;
  StageKeeper keeper = this->keeper([&] {
    if (refusals-- > 0) throw std::runtime_error("no memory");
  });
  EXPECT_FALSE(keeper.attempt(fail));
  int worked = 0;
  for (int tries = 0; tries < 3; ++tries) {
    now_ += milliseconds(1000);
    keeper.attempt([&] { ++worked; });
  }
  EXPECT_EQ(worked, 1);
  EXPECT_EQ(count_of("render: failed"), 3u);
  const std::string failed = "render: has failed and is restarting; recording continues: ";
  EXPECT_EQ(log_.str(),
            failed + "lamp fell down\n" + failed + "no memory\n" + "render: works again\n")
      << "the same failure is reported once";
}

// A camera that is silent just then brings no frame on which the part could show that it works.
TEST_F(StageKeeperTest, APartThatHadNothingToDoDoesNotWorkAgain) {
  StageKeeper keeper = this->keeper();
  EXPECT_FALSE(keeper.attempt(fail));
  now_ += milliseconds(1000);
  EXPECT_TRUE(keeper.attempt([&] { keeper.had_nothing_to_do(); }));
  EXPECT_EQ(count_of("render: restarted"), 0u);
  EXPECT_TRUE(reports_.troubles().at(0).lasts);
  now_ += std::chrono::hours(1);
  EXPECT_TRUE(liveness_.hung().empty()) << "it waits for the next work";
  EXPECT_TRUE(keeper.attempt([] {}));
  EXPECT_EQ(count_of("render: restarted"), 1u);
  EXPECT_FALSE(reports_.troubles().at(0).lasts);
}

TEST_F(StageKeeperTest, WhatIsThrownNeedBeNoError) {
  StageKeeper keeper = this->keeper();
  EXPECT_FALSE(keeper.attempt([] { throw 7; }));
  EXPECT_THAT(log_.str(), HasSubstr("unknown exception"));
}

TEST_F(StageKeeperTest, ATestRehearsesFailures) {
  StageKeeper keeper("tracking",
                     {.reports = reports_,
                      .metrics = metrics_,
                      .liveness = liveness_,
                      .rehearse = [](const std::string& stage) { throw std::runtime_error(stage); },
                      .clock = clock_},
                     &Patience::stage);
  EXPECT_FALSE(keeper.attempt([] { FAIL() << "nothing was rehearsed"; }));
  EXPECT_EQ(count_of("tracking: failed"), 1u);
}

TEST_F(StageKeeperTest, OnlyWorkThatTakesTooLongIsHung) {
  StageKeeper keeper = this->keeper();
  now_ += std::chrono::hours(1);
  EXPECT_TRUE(liveness_.hung().empty()) << "it waits for its first work";
  keeper.attempt([&] {
    now_ += milliseconds(1000);
    EXPECT_TRUE(liveness_.hung().empty());
    now_ += milliseconds(1);
    EXPECT_EQ(liveness_.hung(), std::vector<std::string>{"render"});
    keeper.waits();
    EXPECT_TRUE(liveness_.hung().empty());
    now_ += std::chrono::hours(1);
    keeper.goes_on();
    EXPECT_TRUE(liveness_.hung().empty());
    now_ += milliseconds(1001);
    EXPECT_EQ(liveness_.hung(), std::vector<std::string>{"render"});
  });
  keeper.attempt(fail);
  now_ += std::chrono::hours(1);
  EXPECT_TRUE(liveness_.hung().empty()) << "it waits for the next work";
}

TEST(Liveness, AThreadThatHasEndedIsNotHung) {
  HostClock::Time now{};
  Liveness liveness({[&] { return now; }, {}});
  Liveness::Pulse loop(liveness, "loop");
  {
    Liveness::Pulse camera(liveness, "camera");
    loop.begin(milliseconds(10));
    camera.begin(milliseconds(5));
    now += milliseconds(7);
    EXPECT_EQ(liveness.hung(), std::vector<std::string>{"camera"});
    now += milliseconds(7);
    EXPECT_EQ(liveness.hung(), (std::vector<std::string>{"loop", "camera"}));
  }
  EXPECT_EQ(liveness.hung(), std::vector<std::string>{"loop"});
  loop.begin(milliseconds(10));  // the next piece of work
  EXPECT_TRUE(liveness.hung().empty());
}

}  // namespace previz::pipeline::stage_keeper_test
