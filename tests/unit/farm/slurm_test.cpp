// What Slurm's programs are asked, and what their answers mean. In their place stand scripts that
// write down their arguments; tests/farm does the same with a real cluster.
#include "daemon/tools/farm/slurm.hpp"

#include "daemon/tools/farm/program.hpp"
#include "tests/support/environment_variable.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::farm::slurm_test {

class Slurm : public testing::Test {
 protected:
  Slurm() {
    session::write_content(folder_.plan(), "");
    stand_in("scontrol", "echo 'MaxArraySize            = 1001'");
    stand_in("sbatch",
             "n=$(cat \"$HERE/n\" 2>/dev/null || echo 16); n=$((n + 1)); echo $n > \"$HERE/n\"; "
             "echo $n");
    stand_in("scancel", "");
    stand_in("squeue", "");
    write_scripts(folder_, {"/usr/bin/previzd", folder_.path(), false});
  }
  // Puts a script in the place of a program; it appends its name and arguments to `calls`.
  void stand_in(const std::string& name, const std::string& body) {
    const std::filesystem::path file = directory_ / "bin" / name;
    session::write_content(file, "#!/bin/sh\nHERE='" + directory_.path().string() + "'\necho \"" +
                                     name + " $*\" >> \"$HERE/calls\"\n" + body + "\n");
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  }
  std::string calls() const { return session::content_of(directory_ / "calls"); }

  test::TemporaryDirectory directory_;
  const test::EnvironmentVariable path_{"PATH",
                                        (directory_ / "bin").string() + ":" + std::getenv("PATH")};
  const JobFolder folder_{directory_ / "a job"};
  Job job_;
  std::ostringstream out_;
};

TEST_F(Slurm, GetsArraysThatItAllowsAndTheLastStepAfterThem) {
  job_.wishes = {8, "render", "1:00:00", ""};
  submit_tasks(folder_, job_, 2500, {"--account=film"}, out_);
  EXPECT_EQ(out_.str(), "render: job 17\nrender: job 18\nrender: job 19\ncheck: job 20\n");
  const std::string all = calls();
  EXPECT_THAT(all, HasSubstr("--array=0-1000%8 "));
  EXPECT_THAT(all,
              HasSubstr("--partition=render --time=1:00:00 --exclusive --mem=0 --account=film "));
  EXPECT_THAT(all, HasSubstr("tasks.sh 2002\n"));
  EXPECT_THAT(all, HasSubstr("--dependency=afterany:17:18:19 "));
  EXPECT_EQ(session::content_of(folder_.submitted_file()), out_.str());
}

// Slurm counts the tasks of each array by itself, so that only one array may run.
TEST_F(Slurm, LimitsTheTasksOfAllArrays) {
  job_.wishes.at_once = 8;
  submit_tasks(folder_, job_, 2100, {}, out_);
  EXPECT_THAT(calls(), HasSubstr("--array=0-1000%8 --comment=1001 --dependency=afterany:17 "));
  EXPECT_THAT(calls(), HasSubstr("--array=0-97%8 --comment=2002 --dependency=afterany:18 "));
  EXPECT_THAT(calls(), HasSubstr("--dependency=afterany:17:18:19 "));
}

// The user's own arguments come before those that the job is found by: sbatch takes the last.
TEST_F(Slurm, TakesNoNameAndNoPlaceFromTheUser) {
  submit_tasks(folder_, job_, 1500, {"--gres=gpu:a100:1", "--job-name=x", "--comment=x"}, out_);
  const std::string all = calls();
  for (const char* fixed : {"--job-name=previz-", "--comment=1001", "--chdir=", "--output=log/"})
    EXPECT_GT(all.find(fixed), all.find("--comment=x")) << fixed;
  EXPECT_GT(all.find("--gres=gpu:a100:1"), all.find("--exclusive"));
}

TEST_F(Slurm, IsAskedForAGraphicsCardOrAWholeProcessor) {
  submit_tasks(folder_, job_, 1, {}, out_);
  EXPECT_THAT(calls(), AllOf(HasSubstr("--exclusive --mem=0"), Not(HasSubstr("--gres"))));
  job_.on_gpu = true;
  submit_tasks(folder_, job_, 1, {}, out_);
  EXPECT_THAT(calls(), AllOf(HasSubstr("--gres=gpu:1"), HasSubstr("--array=0-0 ")));
}

// One array was taken and the next is refused: nothing stays in the queue.
TEST_F(Slurm, ThatRefusesAPartGetsNothing) {
  stand_in("sbatch",
           "[ -e \"$HERE/first\" ] && { echo 'sbatch: error: Invalid partition' >&2; exit 1; }; "
           "touch \"$HERE/first\"; echo '17;cluster'");
  EXPECT_EQ(
      test::error_of([&] { submit_tasks(folder_, job_, 1500, {}, out_); }),
      "sbatch does not take the job: sbatch: error: Invalid partition; nothing was submitted");
  EXPECT_THAT(calls(), HasSubstr("scancel --name=" + folder_.name() + "\n"));
  EXPECT_FALSE(was_submitted(folder_));
}

// An sbatch that prints no number may have submitted its part: it is canceled by the job's name.
TEST_F(Slurm, ThatPrintsNoNumberGetsNothing) {
  stand_in("sbatch", "echo accepted");
  EXPECT_THAT(test::error_of([&] { submit_tasks(folder_, job_, 1, {}, out_); }),
              AllOf(HasSubstr("prints no number"), HasSubstr("nothing was submitted")));
  EXPECT_THAT(calls(), HasSubstr("scancel --name=" + folder_.name() + "\n"));
}

// Each number is on disk before the next array is handed over: a crash then hides none.
TEST_F(Slurm, NumbersAreWrittenAtOnce) {
  const std::string seen =
      "cat '" + folder_.submitted_file().string() + "' >> \"$HERE/seen\"; echo 17";
  stand_in("sbatch", seen);
  submit_tasks(folder_, job_, 1, {}, out_);
  EXPECT_THAT(session::content_of(directory_ / "seen"), HasSubstr("17"));
}

TEST_F(Slurm, ThatCannotCancelIsReported) {
  stand_in("sbatch", "[ -e \"$HERE/first\" ] && exit 1; touch \"$HERE/first\"; echo 17");
  stand_in("scancel", "echo 'scancel: error: Unable to contact slurm controller' >&2; exit 1");
  EXPECT_THAT(test::error_of([&] { submit_tasks(folder_, job_, 1500, {}, out_); }),
              AllOf(HasSubstr("may be in the queue already"), HasSubstr("Unable to contact"),
                    HasSubstr("run `scancel --name=" + folder_.name() + "`"),
                    Not(HasSubstr("nothing was submitted"))));
  EXPECT_EQ(session::content_of(folder_.submitted_file()), "render: job 17\n");
}

TEST_F(Slurm, SaysWhichTasksRun) {
  submit_tasks(folder_, job_, 1500, {}, out_);
  stand_in("squeue",
           "echo '17_0|0|RUNNING|node2|None'; echo '18_499|1001|PENDING||Priority'; "
           "echo '19||PENDING||Dependency'");
  const std::vector<QueuedTask> tasks = queued_tasks(folder_);
  ASSERT_EQ(tasks.size(), 3u);
  EXPECT_EQ(tasks[0].number, 0u);
  EXPECT_EQ(tasks[0].node, "node2");
  EXPECT_EQ(tasks[1].number, 1500u);
  EXPECT_EQ(tasks[1].reason, "Priority");
  EXPECT_FALSE(tasks[2].number);
  EXPECT_THAT(calls(), HasSubstr("squeue --noheader --array --name=" + folder_.name() + " "));
}

TEST_F(Slurm, ThatDoesNotAnswerIsAnError) {
  EXPECT_TRUE(queued_tasks(folder_).empty());
  stand_in("squeue",
           "echo 'slurm_load_jobs error: Unable to contact slurm controller' >&2; exit 1");
  EXPECT_THAT(test::error_of([&] { queued_tasks(folder_); }), HasSubstr("Unable to contact"));
}

// The job's name goes by the folder's, and no file in it has a say.
TEST_F(Slurm, CancelsOnlyWhatHasTheJobsName) {
  session::write_content(folder_.submitted_file(), "render: job 1\n");
  cancel_tasks(folder_);
  EXPECT_THAT(calls(), HasSubstr("scancel --name=" + folder_.name() + "\n"));
}

// Its daemon may be down, and its programs then wait for minutes.
TEST_F(Slurm, ThatHangsIsNotWaitedFor) {
  stand_in("hang", "exec sleep 60");
  const ProgramResult result = run_program("hang", {}, std::chrono::milliseconds(50));
  EXPECT_TRUE(result.is_late);
  EXPECT_FALSE(result.is_good());
  EXPECT_EQ(result.why(), "no answer in time");
}

TEST_F(Slurm, IsNotEverywhere) {
  EXPECT_TRUE(has_slurm());
  const test::EnvironmentVariable nowhere("PATH", directory_.path().string());
  EXPECT_FALSE(has_slurm());
}

}  // namespace previz::farm::slurm_test
