// What the scheduler and the shell are given, whatever is in the names.
#include "daemon/tools/farm/scripts.hpp"

#include <nlohmann/json.hpp>

#include "daemon/tools/farm/program.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::farm::scripts_test {

constexpr const char* hostile = "a 'quoted' \"name\" $(touch hit) `touch hit` \\ %a;\nof two lines";

class Scripts : public testing::Test {
 protected:
  // Runs a script with programs of our own in the place of previzd and Slurm's: each writes its
  // arguments, one a line, and ends with the status.
  ProgramResult run(const std::string& script, int status, const std::string& more = "") {
    session::write_content(directory_ / "script.sh", script);
    session::write_content(places_.program,
                           "#!/bin/sh\nprintf 'previzd\\n'; printf '<%s>\\n' \"$@\"\n" +
                               previzd_does_ + "\nexit " + std::to_string(status) + "\n");
    for (const char* name : {"scontrol", "scancel", "sleep"})
      session::write_content(directory_ / "bin" / name,
                             "#!/bin/sh\nprintf '" + std::string(name) +
                                 "'; printf ' %s' \"$@\"; echo\n" +
                                 (name == std::string("sleep") ? sleep_does_ : "") + "\n");
    for (const auto& file : {places_.program, directory_ / "bin/scontrol",
                             directory_ / "bin/scancel", directory_ / "bin/sleep"})
      std::filesystem::permissions(file, std::filesystem::perms::owner_all);
    return run_program("/bin/sh", {"-c", "cd " + shell_word(directory_.path().string()) +
                                             "; PATH=$PWD/bin:$PATH; export PATH " + more +
                                             " SLURM_ARRAY_TASK_ID=3 SLURM_JOB_ID=99 "
                                             "SLURM_ARRAY_JOB_ID=90 SLURM_CPUS_ON_NODE=2; "
                                             "bash script.sh 1000"});
  }
  test::TemporaryDirectory directory_;
  std::string previzd_does_, sleep_does_;  // further lines of those in their places
  ScriptPlaces places_{directory_ / "bin/previzd", directory_ / hostile, false};
};

// Slurm would change the name of a log with a % in it, so that the script writes it.
TEST_F(Scripts, GiveANameToPreviZdAsItIs) {
  std::filesystem::create_directories(places_.job / "log");
  const ProgramResult result = run(slurm_tasks(places_), 0);
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.out, "");
  EXPECT_EQ(session::content_of(places_.job / "log/1000+0003.log"),
            "previzd\n<farm>\n<task>\n<" + places_.job.string() + ">\n<1003>\n");
  EXPECT_FALSE(std::filesystem::exists(directory_ / "hit"));
}

TEST_F(Scripts, SayThatPicturesMayLieElsewhere) {
  places_.job = "/job";
  places_.any_paths = true;
  EXPECT_THAT(run(slurm_tasks(places_), 0).out, HasSubstr("<1003>\n<--any-paths>\n"));
  EXPECT_THAT(run(slurm_finish(places_), 0).out, HasSubstr("<--any-paths>\n"));
}

// Status 75 is tried again elsewhere, but not for ever; status 1 ends the array.
TEST_F(Scripts, RequeueWhatAnotherMachineMayDo) {
  places_.job = "/job";
  const ProgramResult first = run(slurm_tasks(places_), 75);
  EXPECT_EQ(first.status, 75);
  EXPECT_THAT(first.out, HasSubstr("sleep 120\nscontrol requeue 99\n"));
  const ProgramResult last = run(slurm_tasks(places_), 75, "SLURM_RESTART_COUNT=3");
  EXPECT_EQ(last.status, 75);
  EXPECT_THAT(last.out, Not(HasSubstr("requeue")));
  const ProgramResult mistake = run(slurm_tasks(places_), 1);
  EXPECT_EQ(mistake.status, 1);
  EXPECT_THAT(mistake.out, HasSubstr("scancel --state=PENDING 90\n"));
}

TEST_F(Scripts, LoopUntilNothingIsLeftAndFinish) {
  const ProgramResult result = run(shell_loop(places_), 0);
  const std::string name = "<" + places_.job.string() + ">\n";
  const std::string task = "previzd\n<farm>\n<task>\n" + name;
  EXPECT_EQ(result.out, task + "previzd\n<farm>\n<finish>\n" + name);
  EXPECT_EQ(run(shell_loop(places_), 1).out, task);
  // It is for machines that can render to do the last step.
  const ProgramResult refused = run(shell_loop(places_), 75);
  EXPECT_EQ(refused.status, 75);
  EXPECT_EQ(refused.out, task);
  EXPECT_THAT(refused.errors, HasSubstr("this machine leaves the job"));
}

// A task that Ctrl-C ends has status 0, by which a shell takes it that the signal was dealt with.
TEST_F(Scripts, CtrlCEndsTheLoop) {
  previzd_does_ = "kill -INT $PPID; exit 0";
  const ProgramResult result = run(shell_loop(places_), 0);
  EXPECT_EQ(result.status, 130);
  EXPECT_THAT(result.out, AllOf(HasSubstr("<task>"), Not(HasSubstr("<finish>"))));
}

// scancel ends the waiting, or this script, or both.
TEST_F(Scripts, ATaskThatIsCanceledWhileItWaitsIsNotRequeued) {
  places_.job = "/job";
  sleep_does_ = "exit 143";
  ProgramResult canceled = run(slurm_tasks(places_), 75);
  EXPECT_EQ(canceled.status, 75);
  EXPECT_THAT(canceled.out, AllOf(HasSubstr("sleep 120\n"), Not(HasSubstr("requeue"))));
  sleep_does_ = "kill -TERM $PPID; exit 0";
  canceled = run(slurm_tasks(places_), 75);
  EXPECT_THAT(canceled.out, AllOf(HasSubstr("sleep 120\n"), Not(HasSubstr("requeue"))));
  previzd_does_ = "kill -TERM $PPID";
  canceled = run(slurm_tasks(places_), 75);
  EXPECT_THAT(canceled.out, Not(HasSubstr("sleep")));
}

TEST_F(Scripts, DescribeTheJobForOtherSchedulers) {
  places_.job = "/jobs/a \"quoted\" name";
  Job job;
  job.takes.resize(1);
  job.takes[0].frames = {0, 15};
  job.share = 2;
  const auto json = nlohmann::json::parse(openjd_template(places_, job, "previz-1"));
  EXPECT_EQ(json["specificationVersion"], "jobtemplate-2023-09");
  EXPECT_EQ(json["parameterDefinitions"][0]["default"], places_.job.string());
  ASSERT_EQ(json["steps"].size(), 2u);
  const auto& range = json["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0];
  EXPECT_EQ(range["range"], "0-7");
  EXPECT_EQ(json["steps"][1]["dependencies"][0]["dependsOn"], "Render");
  EXPECT_EQ(
      json["steps"][0]["script"]["actions"]["onRun"]["args"],
      (std::vector<std::string>{"farm", "task", "{{Param.JobFolder}}", "{{Task.Param.Number}}"}));
  places_.job = directory_ / hostile;
  EXPECT_THAT(test::error_of([&] { openjd_template(places_, job, "previz-1"); }),
              HasSubstr("no control characters"));
}

}  // namespace previz::farm::scripts_test
