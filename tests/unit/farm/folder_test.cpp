// Tests what a job's folder keeps of its tasks, and that one process at a time does its last step.
#include "daemon/tools/farm/folder.hpp"

#include "daemon/tools/farm/finish.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::farm::folder_test {

class FarmFolder : public testing::Test {
 protected:
  FarmFolder() { std::filesystem::create_directories(directory_ / "state"); }

  const test::TemporaryDirectory directory_;
  const JobFolder folder_{directory_.path()};
  std::ostringstream out_;
};

TEST_F(FarmFolder, KnowsATaskByItsNumberOrItsMachine) {
  EXPECT_EQ(task_name(7, "node1"), "0007");
  EXPECT_EQ(task_name(12345, "node1"), "12345");
  EXPECT_EQ(task_name({}, "node-1.farm"), "on-node-1.farm");
  EXPECT_EQ(task_name({}, "../a b"), "on-.._a_b");
}

TEST_F(FarmFolder, HasWhatTasksSaidUntilItIsForgotten) {
  folder_.write_state("0003", state_now(TaskOutcome::machine, "node1", "full\nof it"));
  folder_.write_state(finish_name, state_now(TaskOutcome::done, "node2", ""));
  session::write_content(directory_ / "state/0004.json", "{\"outcome\": \"dancing\"}");
  session::write_content(directory_ / "state/0005.json", "half of i");
  session::write_content(folder_.stopped_file(), "because");
  const auto states = folder_.read_states();
  ASSERT_EQ(states.size(), 1u);
  EXPECT_EQ(states.at("0003").message, "full of it");
  EXPECT_EQ(folder_.read_state(finish_name)->host, "node2");
  folder_.forget_states();
  EXPECT_TRUE(folder_.read_states().empty());
  EXPECT_FALSE(folder_.read_state(finish_name));
  EXPECT_EQ(folder_.read_stopped(), "");
}

// Notes that a line was written to it.
class NoticedBuffer : public std::stringbuf {
 public:
  std::atomic<bool> has_line = false;

 private:
  int sync() override {
    has_line = true;
    return 0;
  }
};

TEST_F(FarmFolder, IsFinishedByOneAtATime) {
  std::optional<JobLock> first(std::in_place, folder_, out_, std::stop_token());
  EXPECT_FALSE(first->has_waited());
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(test::error_of([&] { JobLock(folder_, out_, stop.get_token()); }),
              HasSubstr("another last step was at work"));
  EXPECT_THAT(out_.str(), HasSubstr("waits for the last step or retry of previzd"));
  NoticedBuffer buffer;
  std::ostream out(&buffer);
  const std::jthread end([&] {
    EXPECT_TRUE(test::wait_until("the second waits", [&] { return buffer.has_line.load(); }));
    first.reset();
  });
  EXPECT_TRUE(JobLock(folder_, out, {}).has_waited());
}

}  // namespace previz::farm::folder_test
