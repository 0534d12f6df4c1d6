// What a submission leaves behind, and what it takes from an earlier one. Scripts stand in for
// Slurm's programs.
#include "daemon/tools/farm/farm.hpp"
#include "daemon/tools/post/render.hpp"
#include "tests/support/environment_variable.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/test.hpp"

namespace previz::farm::submit_test {

class FarmSubmission : public testing::Test {
 protected:
  FarmSubmission() {
    test::write_small_take(directory_.path());
    options_.takes = {directory_ / "session"};
    options_.render.directory = directory_ / "out";
    options_.job = folder_.path();
    options_.on_gpu = false;
    options_.any_device = true;
    for (const char* name : {"squeue", "scancel", "scontrol"}) stand_in(name, "");
    stand_in("sbatch", "echo \"sbatch $*\" >> '" + (directory_ / "calls").string() + "'; echo 17");
  }
  void stand_in(const std::string& name, const std::string& body) {
    const std::filesystem::path file = directory_ / "bin" / name;
    session::write_content(file, "#!/bin/sh\n" + body + "\n");
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  }
  void submit() { farm::submit(options_, out_); }
  std::string refusal() {
    return test::error_of([&] { submit(); });
  }
  JobOptions job() const {
    JobOptions job;
    job.job = folder_.path();
    return job;
  }
  // Renders all frames without a video.
  void render() const {
    post::RenderOptions options = options_.render;
    options.session = directory_ / "session";
    options.video = false;
    std::ostringstream out;
    post::render_session(options, out);
  }
  bool has_folder() const { return std::filesystem::exists(folder_.path()); }

  test::TemporaryDirectory directory_;
  const test::EnvironmentVariable path_{"PATH",
                                        (directory_ / "bin").string() + ":" + std::getenv("PATH")};
  const JobFolder folder_{directory_ / "job"};
  FarmOptions options_;
  std::ostringstream out_;
};

TEST_F(FarmSubmission, ThatIsRefusedLeavesNoFolder) {
  stand_in("sbatch",
           "[ \"$1\" = --version ] || { echo 'sbatch: error: Invalid partition' >&2; exit 1; }");
  options_.wishes.partition = "rendr";
  EXPECT_THAT(refusal(), HasSubstr("Invalid partition; nothing was submitted"));
  EXPECT_FALSE(has_folder());
  stand_in("sbatch", "echo 17");
  EXPECT_EQ(refusal(), "");
  EXPECT_TRUE(has_folder());
}

// A folder that was there before holds what is not the job's.
TEST_F(FarmSubmission, ThatIsRefusedLeavesAFolderThatWasThere) {
  const std::array mine{"notes.txt", "state/notes.json", "sums/0000/1/notes.txt"};
  for (const char* file : mine) session::write_content(folder_.path() / file, "mine");
  stand_in("sbatch", "[ \"$1\" = --version ]");
  EXPECT_THAT(refusal(), HasSubstr("nothing was submitted"));
  for (const char* file : mine) EXPECT_TRUE(std::filesystem::exists(folder_.path() / file)) << file;
  EXPECT_FALSE(std::filesystem::exists(folder_.plan()));
}

// Somebody has removed an earlier job's plan alone: what it said last is not the new one's word.
TEST_F(FarmSubmission, TakesNoWordOfAnEarlierJob) {
  std::filesystem::create_directories(folder_.path() / "state");
  const TaskState done = state_now(TaskOutcome::done, "node1", "");
  folder_.write_state(finish_name, done);
  folder_.write_state("0000", done);
  stand_in("sbatch", "echo 17");
  EXPECT_EQ(refusal(), "");
  EXPECT_FALSE(folder_.read_state(finish_name));
  EXPECT_FALSE(folder_.read_state("0000"));
}

// A part that cannot be taken back is canceled by the folder.
TEST_F(FarmSubmission, ThatStaysInTheQueueKeepsItsFolder) {
  const std::string once = (directory_ / "once").string();
  stand_in("sbatch", "[ \"$1\" = --version ] && exit 0; [ -e '" + once + "' ] && exit 1; touch '" +
                         once + "'; echo 17");
  stand_in("scancel", "exit 1");
  EXPECT_THAT(refusal(), HasSubstr("may be in the queue already"));
  EXPECT_TRUE(has_folder());
}

TEST_F(FarmSubmission, WhileTasksOfAnEarlierOneAreInTheQueueIsRefused) {
  stand_in("squeue", "echo '17_0|0|PENDING||Priority'");
  EXPECT_THAT(refusal(), HasSubstr("tasks of an earlier job in this folder"));
  EXPECT_FALSE(has_folder());
}

TEST_F(FarmSubmission, OfFramesThatAreAllRenderedMakesTheVideo) {
  render();
  options_.render.video = true;
  submit();
  EXPECT_THAT(out_.str(), HasSubstr("all of these frames are rendered already"));
  EXPECT_TRUE(std::filesystem::exists(directory_ / "out/review.mp4") ||
              std::filesystem::exists(directory_ / "out/review.mkv"));
  EXPECT_FALSE(has_folder());
}

// The refusal names --force, which forgets the frames once for all tasks.
TEST_F(FarmSubmission, RendersFramesOfOtherSettingsAgainWithForce) {
  render();
  options_.render.samples = 3;
  EXPECT_THAT(refusal(), HasSubstr("--force"));
  EXPECT_FALSE(has_folder());
  options_.render.force = true;
  EXPECT_EQ(refusal(), "");
  EXPECT_TRUE(has_folder());
}

// Tasks start in the job's folder.
TEST_F(FarmSubmission, NamesTheProgramByItsWholePath) {
  options_.dry_run = true;
  options_.program = "build/./previzd";
  submit();
  const std::filesystem::path here = std::filesystem::current_path();
  EXPECT_THAT(out_.str(), HasSubstr("previzd='" + (here / "build/previzd").string() + "'"));
  out_.str("");
  options_.program = "previzd";
  submit();
  EXPECT_THAT(out_.str(), HasSubstr("previzd='previzd'"));
}

TEST_F(FarmSubmission, MayBeTriedAgainWithOtherWishes) {
  options_.wishes.partition = "wrong";
  options_.wishes.time = "1:00:00";
  submit();
  JobOptions again = job();
  again.wishes.partition = "right";
  retry(again, out_);
  EXPECT_THAT(session::content_of(directory_ / "calls"),
              HasSubstr("--partition=right --time=1:00:00 "));
}

// A task that is being requeued meanwhile finds the job stopped.
TEST_F(FarmSubmission, ThatIsCanceledIsStopped) {
  submit();
  cancel(job(), out_);
  EXPECT_THAT(out_.str(), HasSubstr(": nothing is in the queue under the job's name, previz-"));
  EXPECT_EQ(folder_.read_stopped(), "");
  stand_in("squeue", "echo '17_0|0|RUNNING|node1|None'");
  cancel(job(), out_);
  EXPECT_THAT(out_.str(), HasSubstr(": canceled; "));
  EXPECT_EQ(folder_.read_stopped(), "`previz farm cancel`\n");
  stand_in("squeue", "");
  retry(job(), out_);
  EXPECT_EQ(folder_.read_stopped(), "");
}

TEST_F(FarmSubmission, ThatWasNeverMadeCannotBeCanceled) {
  stand_in("sbatch", "exit 1");  // there is no Slurm
  submit();
  EXPECT_THAT(test::error_of([&] { cancel(job(), out_); }), HasSubstr("end loop.sh"));
}

}  // namespace previz::farm::submit_test
