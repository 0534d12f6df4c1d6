// Who is at work in a job's folder, on file systems with locks and without.
#include "daemon/tools/farm/folder.hpp"

#include "daemon/core/session/draft.hpp"
#include "daemon/tools/farm/job_lock.hpp"
#include "daemon/tools/farm/signs_of_life.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::farm::folder_test {

int no_locks(int, int, struct flock*) {
  errno = ENOSYS;
  return -1;
}

class FarmFolder : public testing::Test {
 protected:
  FarmFolder() {
    std::filesystem::create_directories(directory_ / "state");
    std::filesystem::create_directories(folder_.chunk(0));
    session::replace_file(folder_.plan(), "{}");
  }
  // Makes the file older than a sign of life can be.
  static void grow_old(const std::filesystem::path& file) {
    std::filesystem::last_write_time(
        file, std::filesystem::last_write_time(file) - std::chrono::minutes(4));
  }

  const test::TemporaryDirectory directory_;
  const JobFolder folder_{directory_.path()}, without_locks_{directory_.path(), no_locks};
  std::ostringstream out_;
  const TaskState running_ = state_now(TaskOutcome::running, "machine1", "");
};

TEST_F(FarmFolder, WithoutLocksATaskIsKnownByItsSignsOfLife) {
  EXPECT_TRUE(folder_.has_locks());
  EXPECT_FALSE(without_locks_.has_locks());
  EXPECT_EQ(without_locks_.taken(0), Taken::no);
  folder_.write_state(0, running_);
  EXPECT_EQ(without_locks_.taken(0), Taken::alone);
  EXPECT_EQ(folder_.taken(0), Taken::no) << "it has died: its locks are gone";
  grow_old(folder_.state_file(0));
  EXPECT_EQ(without_locks_.taken(0), Taken::no);
  {
    const SignsOfLife signs(folder_.state_file(0), std::chrono::milliseconds(5));
    EXPECT_TRUE(
        test::wait_until("it is renewed", [&] { return without_locks_.taken(0) == Taken::alone; }));
  }
  folder_.write_state(0, state_now(TaskOutcome::done, "machine1", ""));
  EXPECT_EQ(without_locks_.taken(0), Taken::no);
}

// A machine that has locks respects one that has none.
TEST_F(FarmFolder, AMachineWithLocksKnowsOneWithout) {
  without_locks_.write_state(0, running_);
  without_locks_.write_finish_state(running_);
  EXPECT_EQ(folder_.taken(0), Taken::alone);
  EXPECT_TRUE(folder_.living_finish());
  folder_.write_finish_state(running_);
  EXPECT_FALSE(folder_.living_finish());
}

// A retry that fails does not undo that the job is done.
TEST_F(FarmFolder, ALockThatIsGivenUpLeavesWhatWasDone) {
  folder_.write_finish_state(state_now(TaskOutcome::done, "a", ""));
  { const JobLock lock(folder_, "b", out_, {}); }
  EXPECT_EQ(folder_.read_finish_state()->outcome, TaskOutcome::done);
  folder_.write_finish_state(state_now(TaskOutcome::machine, "a", "full"));
  { const JobLock lock(folder_, "b", out_, {}); }
  EXPECT_EQ(folder_.read_finish_state()->outcome, TaskOutcome::stopped);
  JobLock(folder_, "b", out_, {}).end_without_word();
  EXPECT_FALSE(folder_.read_finish_state());
}

// A process that hangs while it changes the folder does not hold up `farm status`.
TEST_F(FarmFolder, ATaskIsSeenWithoutWaitingForIt) {
  EXPECT_EQ(folder_.taken(1), Taken::no) << "it has no folder";
  post::FolderLocks other(folder_.chunk(0));
  const post::FolderLocks::Transaction transaction(other);
  EXPECT_EQ(folder_.taken(0), Taken::no);
  other.join();
  EXPECT_EQ(folder_.taken(0), Taken::shared);
}

TEST_F(FarmFolder, WithoutLocksTheLastStepWaitsForAnotherThatIsAlive) {
  folder_.write_finish_state(running_);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THAT(test::error_of([&] { JobLock(without_locks_, "b", out_, stop.get_token()); }),
              HasSubstr("another last step was at work"));
  EXPECT_THAT(out_.str(), HasSubstr("waits for the last step or retry of machine1, since "));
  EXPECT_EQ(folder_.read_finish_state()->host, "machine1") << "it has said nothing";
  grow_old(folder_.finish_state_file());
  JobLock lock(without_locks_, "b", out_, stop.get_token());
  EXPECT_EQ(folder_.read_finish_state()->host, "b");
  EXPECT_FALSE(lock.is_complete());
}

// Two that see nobody at the same moment.
TEST_F(FarmFolder, WithoutLocksOneOfTwoLastStepsGoesFirst) {
  std::vector<std::string> order;
  std::mutex mutex;
  const auto finish = [&](const std::string& host) {
    const JobFolder folder(directory_.path(), no_locks);
    std::ostringstream out;
    JobLock lock(folder, host, out, {});
    const auto note = [&](const char* what) {
      const std::lock_guard guard(mutex);
      order.push_back(host + what);
    };
    note(" begins");
    // Time for the other one to begin, too, if nothing kept it from that.
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    note(" ends");
    lock.end(TaskOutcome::done, "");
  };
  {
    const std::jthread first([&] { finish("a"); }), second([&] { finish("b"); });
  }
  ASSERT_EQ(order.size(), 4u);
  EXPECT_EQ(order[0].substr(0, 1), order[1].substr(0, 1)) << order[0] << ", " << order[1];
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

TEST_F(FarmFolder, TheLastStepWaitsForOneThatHasTheLock) {
  for (const TaskOutcome outcome : {TaskOutcome::machine, TaskOutcome::done}) {
    folder_.write_finish_state(state_now(TaskOutcome::done, "earlier", ""));
    std::optional<JobLock> first(std::in_place, folder_, "a", out_, std::stop_token());
    EXPECT_FALSE(first->is_complete()) << "nobody was waited for";
    NoticedBuffer buffer;
    std::ostream out(&buffer);
    const std::jthread end([&] {
      EXPECT_TRUE(test::wait_until("b waits", [&] { return buffer.has_line.load(); }));
      first->end(outcome, "");
      first.reset();
    });
    EXPECT_EQ(JobLock(folder_, "b", out, {}).is_complete(), outcome == TaskOutcome::done);
  }
}

}  // namespace previz::farm::folder_test
