// What `previz farm status` says, by a job's folder and the answers of a Slurm that scripts stand
// in for.
#include "daemon/tools/farm/status.hpp"

#include "daemon/core/report/printable.hpp"
#include "daemon/tools/farm/farm.hpp"
#include "daemon/tools/farm/finish.hpp"
#include "daemon/tools/post/folder_locks.hpp"
#include "tests/support/environment_variable.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::farm::status_test {

class FarmStatus : public testing::Test {
 protected:
  FarmStatus() {
    job_.takes.emplace_back();
    job_.takes[0].session = "/takes/12A";
    job_.takes[0].pictures = directory_ / "out";
    job_.takes[0].frames = {0, 3};
    job_.takes[0].settings = "{}";
    std::filesystem::create_directories(folder_.path() / "state");
    session::write_content(folder_.submitted_file(), "render: job 17\n");
    stand_in("sbatch", "");
    queue("");
  }
  void stand_in(const std::string& name, const std::string& body) {
    const std::filesystem::path file = directory_ / "bin" / name;
    session::write_content(file, "#!/bin/sh\n" + body + "\n");
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  }
  // The lines that squeue prints for the job's name.
  void queue(const std::string& lines) {
    session::write_content(directory_ / "queue", lines);
    stand_in("squeue",
             "case \"$*\" in *--name=*) cat '" + (directory_ / "queue").string() + "';; esac");
  }
  void say(std::uint64_t task, TaskOutcome outcome, const std::string& message) {
    folder_.write_state(task_name(task, ""),
                        {outcome, "node1", 1, "2026-11-28 20:03:11 UTC", message});
  }
  static JobStatus all_done() {
    JobStatus status;
    status.frames = status.done = status.parts = status.parts_done = 4;
    return status;
  }
  std::string words(const JobStatus& status) const {
    std::ostringstream out;
    print_words(folder_, job_, status, false, out);
    return out.str();
  }
  std::string words() const { return words(status_of(folder_, job_)); }

  test::TemporaryDirectory directory_;
  const test::EnvironmentVariable path_{"PATH",
                                        (directory_ / "bin").string() + ":" + std::getenv("PATH")};
  const JobFolder folder_{directory_ / "job"};
  Job job_;
};

// The machine holds the task for two minutes, and Slurm says meanwhile that it runs.
TEST_F(FarmStatus, NamesWhyATaskWaitsToBeRequeued) {
  say(0, TaskOutcome::machine, "previzd 0.0 is installed here");
  queue("17_0|0|RUNNING|node1|None\n17_1|0|RUNNING|node2|None\n18||PENDING||Dependency\n");
  EXPECT_EQ(words(),
            "0 of 4 frames done, 1 task running, 1 waiting again, 0 failed\n"
            "task 0000: waiting to be requeued: node1: previzd 0.0 is installed here\n"
            "task 0001: running on node2\n");
}

// The task runs again elsewhere, and has not said so yet.
TEST_F(FarmStatus, NamesTheMachineThatSlurmKnows) {
  say(0, TaskOutcome::stopped, "");
  queue("17_0|0|RUNNING|node3|None\n");
  EXPECT_THAT(words(), HasSubstr("task 0000: running on node3\n"));
}

TEST_F(FarmStatus, SaysWhyTasksWait) {
  queue(
      "17_0|0|PENDING||DependencyNeverSatisfied\n17_1|0|PENDING||JobHeldUser\n"
      "18||PENDING||DependencyNeverSatisfied\n");
  EXPECT_EQ(words(),
            "0 of 4 frames done, 0 tasks running, 0 failed\n"
            "waiting in the queue: DependencyNeverSatisfied (1 task)\n"
            "waiting in the queue: JobHeldUser (1 task)\n"
            "waiting in the queue: DependencyNeverSatisfied (the last step)\n");
}

TEST_F(FarmStatus, TakesNoOtherStateOfSlurmForAFailure) {
  for (const char* state :
       {"COMPLETING", "CONFIGURING", "SUSPENDED", "REQUEUED", "REQUEUE_HOLD", "SPECIAL_EXIT"}) {
    say(0, TaskOutcome::running, "");
    queue("17_0|0|" + std::string(state) + "|node1|None\n");
    EXPECT_EQ(words(), "0 of 4 frames done, 0 tasks running, 0 failed\nwaiting in the queue: " +
                           std::string(state) + " (1 task)\n");
  }
}

TEST_F(FarmStatus, OfATaskThatIsGoneIsAFailure) {
  say(0, TaskOutcome::running, "");
  say(1, TaskOutcome::machine, "no Vulkan device");
  EXPECT_EQ(words(),
            "0 of 4 frames done, 0 tasks running, 2 failed\n"
            "task 0000: ended on node1 before its time\n"
            "task 0001: node1: no Vulkan device\n"
            "nothing runs under this job's name, " +
                folder_.name() + ": `previz farm retry` renders what is missing\n");
}

TEST_F(FarmStatus, SaysWhatIsToBeDoneAfterALastStepThatFailed) {
  const std::string finish = "`previz farm finish " + folder_.path().string() + "`";
  JobStatus status = all_done();
  EXPECT_EQ(words(status),
            "4 of 4 frames done, 0 tasks running, 0 failed\nthe last step has not run; " + finish +
                " does it\n");
  status.finish = TaskState{TaskOutcome::machine, "node1", 1, "20:03", "no space left"};
  EXPECT_THAT(words(status), HasSubstr("\nthe last step has failed on node1: no space left; " +
                                       finish + " does it again\n"));
  status.finish->outcome = TaskOutcome::running;
  EXPECT_THAT(words(status), HasSubstr("\nthe last step began on node1 at 20:03; where it does "
                                       "not run any more, " +
                                       finish));
  status.finish_queue = "RUNNING";
  EXPECT_THAT(words(status), testing::EndsWith("\nthe last step runs\n"));
  status.finish_queue.clear();
  status.finish->outcome = TaskOutcome::done;
  EXPECT_THAT(words(status),
              testing::EndsWith("\npictures: " + (directory_ / "out").string() + "\n"));
}

// Without Slurm a task is known by its place in the job's folder, and its frames by theirs.
TEST_F(FarmStatus, KnowsWhoIsAlive) {
  std::filesystem::create_directories(directory_ / "out");
  stand_in("sbatch", "exit 1");
  std::optional<post::FolderLocks> job(std::in_place, folder_.path()),
      pictures(std::in_place, directory_ / "out");
  for (auto* locks : {&*job, &*pictures}) {
    const post::FolderLocks::Transaction transaction(*locks);
    locks->join();
    if (locks == &*pictures) {
      EXPECT_FALSE(locks->claim({2}, 1).empty());
    }
  }
  const std::string name = task_name({}, post::host_name());
  folder_.write_state(name, state_now(TaskOutcome::running, post::host_name(), ""));
  EXPECT_THAT(words(), AllOf(HasSubstr("1 task running, 0 failed"),
                             HasSubstr("task " + name + ": running on " + post::host_name() +
                                       ", frame 2 of 12A\n")));
  pictures.reset();
  job.reset();
  EXPECT_THAT(words(), HasSubstr("0 tasks running, 1 failed"));
}

TEST_F(FarmStatus, CountsSampleRanges) {
  JobStatus status = all_done();
  status.parts = 16;
  status.done = 1;
  status.parts_done = 7;
  status.seconds_a_part = 60;
  status.tasks["0000"].is_running = true;
  EXPECT_THAT(words(status), StartsWith("1 of 4 frames done, 7 of their 16 sample ranges, 1 task "
                                        "running, 0 failed, about 9:00 left\n"));
}

// What stands in files is data: it moves no cursor, and no line of it looks like one of ours.
TEST_F(FarmStatus, PrintsEveryTextOnOneLine) {
  say(0, TaskOutcome::machine, "a\nb\x1b]0;title\x07");
  say(1, TaskOutcome::running, "");
  session::write_content(folder_.stopped_file(), "chunk 0: \x1b[31mred\r\nnothing runs\n");
  const std::string said = words();
  EXPECT_THAT(said, HasSubstr("task 0000: node1: a b\\x1b]0;title\\x07\n"));
  EXPECT_THAT(said, HasSubstr("\nstopped: chunk 0: \\x1b[31mred\\x0d nothing runs\n"));
  EXPECT_THAT(said, Not(HasSubstr("\x1b")));
}

TEST_F(FarmStatus, PrintsWhatIsMissingLikewise) {
  job_.takes[0].session = "/takes/12A\x1b[2J";
  Proof proof;
  proof.missing.push_back({0, {1}, "on node1: a\nb\x07"});
  proof.notes = {"a\x1b[31m card"};
  std::ostringstream out;
  print_missing(folder_, job_, proof, out);
  EXPECT_THAT(out.str(), StartsWith("a\\x1b[31m card\n12A\\x1b[2J: frame 1: on node1: a b\\x07\n"));
}

}  // namespace previz::farm::status_test
