// A whole job on a small take, without a scheduler: plan, tasks, last step. What stands in
// JOB/state and JOB/missing.json is what the crew reads in the morning.
#include "daemon/tools/farm/task.hpp"

#include <nlohmann/json.hpp>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/farm/farm.hpp"
#include "daemon/tools/farm/finish.hpp"
#include "daemon/tools/farm/plan.hpp"
#include "daemon/tools/farm/status.hpp"
#include "daemon/tools/post/folder_locks.hpp"
#include "daemon/tools/post/render.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "tests/support/environment_variable.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::farm::task_test {

using session::content_of;
using session::write_content;

class FarmTask : public testing::Test {
 protected:
  FarmTask() {
    test::write_small_take(directory_.path());
    options_.takes = {directory_ / "session"};
    options_.render.directory = directory_ / "out";
    options_.render.video = true;
    options_.job = directory_ / "job";
    options_.on_gpu = false;
    options_.any_device = true;  // these tests run on whatever there is
    options_.division.chunk = 3;
    machine_ = this_machine();
    machine_.open_device = [](const render::DeviceOptions& options) {
      static const std::shared_ptr<render::Device> device = render::open_device(options);
      return device;
    };
  }
  void submit() { farm::submit(options_, out_); }
  // Without a number it renders until nothing is left.
  int run(std::optional<std::uint64_t> number = {}, const std::stop_token& stop = {}) {
    TaskOptions task;
    task.stop = stop;
    task.job = folder_.path();
    task.number = number;
    return run_task(task, machine_, out_);
  }
  std::string said(std::uint64_t number) const {
    return state_of(folder_.read_state(task_name(number, "")));
  }
  int finish() {
    out_.str("");
    return farm::finish(job_options(), out_);
  }
  JobOptions job_options() const {
    JobOptions job;
    job.job = folder_.path();
    return job;
  }
  void divide_samples(int ranges) {
    options_.render.samples = 256;
    options_.render.neighbours = 0;
    options_.division.sample_ranges = ranges;
  }
  bool has_picture(std::uint64_t frame) const {
    return std::filesystem::exists(directory_ / "out" / post::frame_file(frame, ".exr"));
  }
  void run_all() {
    const Job job = folder_.read_plan();
    for (std::uint64_t number = 0; number < job.tasks(job.frames()); ++number)
      EXPECT_EQ(run(number), task_status::done) << out_.str();
  }
  // Renders the take in one run beside the job's pictures, and compares every file.
  void expect_pictures_of_one_run(post::RenderOptions options) {
    options.session = directory_ / "session";
    options.directory = directory_ / "one";
    options.video = true;
    std::ostringstream out;
    post::render_session(options, out);
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(directory_ / "one")) {
      const std::string name = entry.path().filename().string();
      if (name == "render.lock" || name == "frames.jsonl") continue;
      ++files;
      EXPECT_TRUE(content_of(entry.path()) == content_of(directory_ / "out" / name)) << name;
    }
    EXPECT_EQ(files, std::size_t{2 * test::small_take_frames + 2});  // render.json and the video
  }
  static std::string state_of(const std::optional<TaskState>& state) {
    return state ? std::string(name_of(state->outcome)) + ": " + state->message : "none";
  }

  test::TemporaryDirectory directory_;
  const test::EnvironmentVariable nowhere_{"PATH", "/nowhere"};  // there is no Slurm
  const JobFolder folder_{directory_ / "job"};
  FarmOptions options_;
  Machine machine_;
  std::ostringstream out_;
};

TEST_F(FarmTask, MakesThePicturesOfOneRun) {
  submit();
  EXPECT_THAT(out_.str(), HasSubstr("8 frames of 1 take in 3 tasks"));
  EXPECT_THAT(out_.str(), HasSubstr("There is no Slurm here"));
  EXPECT_EQ(run(0), task_status::done) << out_.str();
  EXPECT_TRUE(has_picture(2));
  EXPECT_FALSE(has_picture(3)) << "it ends with its share";
  run_all();
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  EXPECT_FALSE(std::filesystem::exists(folder_.missing_file()));
  expect_pictures_of_one_run({});
}

TEST_F(FarmTask, MergesSampleRangesToThePicturesOfOneRun) {
  divide_samples(4);
  submit();
  EXPECT_EQ(folder_.read_plan().tasks(8), 11u);
  run_all();
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  EXPECT_FALSE(std::filesystem::exists(folder_.place("sums")));
  expect_pictures_of_one_run(options_.render);
  out_.str("");
  EXPECT_EQ(run(), task_status::done);  // as a machine that comes to the loop late
  EXPECT_THAT(out_.str(), Not(HasSubstr("samples in")));
}

// The frames are rendered as pictures and in sample ranges, by a task with a number and by one that
// goes on until nothing is left.
TEST_F(FarmTask, RendersTheFramesThatWereAskedFor) {
  for (const int ranges : {1, 2}) {
    divide_samples(ranges);
    options_.render.frames = post::FrameRange{4, 5};
    options_.render.directory = directory_ / ("out" + std::to_string(ranges));
    options_.job = directory_ / ("job" + std::to_string(ranges));
    options_.division.chunk = 1;
    submit();
    TaskOptions task;
    task.job = *options_.job;
    for (const std::optional<std::uint64_t> number : {std::optional<std::uint64_t>(0), {}}) {
      task.number = number;
      EXPECT_EQ(run_task(task, machine_, out_), task_status::done) << out_.str();
    }
    JobOptions job;
    job.job = *options_.job;
    EXPECT_EQ(farm::finish(job, out_), task_status::done) << out_.str();
    const std::filesystem::path pictures = *options_.render.directory;
    EXPECT_TRUE(std::filesystem::exists(pictures / "0004.exr"));
    EXPECT_TRUE(std::filesystem::exists(pictures / "0005.exr"));
    EXPECT_FALSE(std::filesystem::exists(pictures / "0000.exr"));
  }
}

TEST_F(FarmTask, OfFramesThatCannotBeDividedIsRefusedBeforeTheNight) {
  options_.division.sample_ranges = 4;
  EXPECT_THAT(test::error_of([&] { submit(); }), HasSubstr("--neighbours 0"));
  EXPECT_FALSE(std::filesystem::exists(directory_ / "job"));
}

TEST_F(FarmTask, IsRenderedWithTheSetAsItWas) {
  std::filesystem::copy_file(directory_ / "set.toml", directory_ / "other.toml");
  options_.render.set_file = directory_ / "other.toml";
  submit();
  std::filesystem::rename(directory_ / "other.toml", directory_ / "kept.toml");
  std::filesystem::rename(directory_ / "card.gltf", directory_ / "kept.gltf");
  run_all();
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  std::filesystem::rename(directory_ / "kept.toml", directory_ / "other.toml");
  std::filesystem::rename(directory_ / "kept.gltf", directory_ / "card.gltf");
  post::RenderOptions one;
  one.set_file = directory_ / "other.toml";
  expect_pictures_of_one_run(one);
}

// The set is the take's own, and was changed by hand after the job was made.
TEST_F(FarmTask, OfAnotherSetStopsTheJob) {
  submit();
  const std::filesystem::path file = directory_ / "session/session.toml";
  std::string text = content_of(file);
  text.replace(text.find("samples = 2"), 11, "samples = 3");
  write_content(file, text);
  EXPECT_EQ(run(0), task_status::job_fault);
  EXPECT_THAT(said(0), AllOf(StartsWith("job: "),
                             HasSubstr("was changed since the job was made (samples is 2")));
  EXPECT_EQ(run(1), task_status::job_fault);
  EXPECT_THAT(out_.str(), HasSubstr("the job was stopped: task 0000: "));
  EXPECT_EQ(said(1), "none");
  EXPECT_FALSE(has_picture(0));
}

TEST_F(FarmTask, OnAMachineThatCannotIsForAnother) {
  submit();
  machine_.host = "node2";
  machine_.software = "previzd 0.0";
  EXPECT_EQ(run(1), task_status::machine_fault);
  EXPECT_THAT(said(1), StartsWith("machine: previzd 0.0 is installed here"));
  machine_ = this_machine();
  machine_.open_device = [](const auto&) -> std::shared_ptr<render::Device> {
    throw Error("no Vulkan device");
  };
  EXPECT_EQ(run(2), task_status::machine_fault);
  EXPECT_EQ(said(2), "machine: no Vulkan device");
  print_status(job_options(), out_);
  EXPECT_THAT(out_.str(), HasSubstr("0 of 8 frames done, 0 tasks running, 2 failed"));
  EXPECT_THAT(out_.str(), HasSubstr("task 0001: node2: previzd 0.0 is installed here"));
}

TEST_F(FarmTask, ThatIsMissingIsNamedAndTriedAgain) {
  submit();
  EXPECT_EQ(run(0), task_status::done);
  EXPECT_EQ(run(2), task_status::done);
  EXPECT_EQ(finish(), task_status::machine_fault);
  EXPECT_THAT(out_.str(), HasSubstr("session: frames 6 to 7: not rendered: no task has come"));
  EXPECT_THAT(out_.str(), HasSubstr("2 frames are missing; `previz farm retry`"));
  const auto missing = nlohmann::json::parse(content_of(folder_.missing_file()));
  EXPECT_EQ(missing[0]["frames"], (std::vector<int>{6, 7}));
  EXPECT_EQ(folder_.read_state(farm::finish_name).value().message, "frames are missing");
  const auto before = std::filesystem::last_write_time(directory_ / "out/0000.exr");
  EXPECT_EQ(run(1), task_status::done);
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  EXPECT_EQ(std::filesystem::last_write_time(directory_ / "out/0000.exr"), before);
  EXPECT_FALSE(std::filesystem::exists(folder_.missing_file()));
}

// What a task has said is named where nobody has rendered the frames.
TEST_F(FarmTask, ThatFailedIsTheReasonForWhatIsMissing) {
  submit();
  machine_.host = "node2";
  machine_.free_bytes = [](const auto&) -> std::uint64_t { return 0; };
  EXPECT_EQ(run(0), task_status::machine_fault);
  EXPECT_EQ(finish(), task_status::machine_fault);
  EXPECT_THAT(out_.str(), HasSubstr("session: frames 0 to 7: on node2: "));
  EXPECT_THAT(out_.str(), HasSubstr("0 MB are free"));
}

TEST_F(FarmTask, WhosePictureWasDamagedIsFoundAndTriedAgain) {
  submit();
  run_all();
  for (const char* picture : {"0001.exr", "0004.png"}) {
    write_content(directory_ / "out" / picture, "damaged");
    EXPECT_EQ(finish(), task_status::machine_fault);
    EXPECT_THAT(out_.str(), HasSubstr(" has another size"));
    EXPECT_THAT(out_.str(), HasSubstr("1 frame is missing"));
    farm::retry(job_options(), out_);
    EXPECT_EQ(run(0), task_status::done);
    EXPECT_EQ(finish(), task_status::done) << out_.str();
  }
  expect_pictures_of_one_run({});
}

TEST_F(FarmTask, ThatIsStoppedAtItsStartStopsNoOther) {
  submit();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(run(0, stop.get_token()), task_status::done);
  EXPECT_THAT(said(0), StartsWith("stopped: "));
  EXPECT_EQ(folder_.read_stopped(), "");
  EXPECT_EQ(run(0), task_status::done) << out_.str();
}

// The disk may be gone from this machine alone, in the middle of the take.
TEST_F(FarmTask, ThatCannotReadTheTakeIsForAnotherMachine) {
  submit();
  std::filesystem::remove_all(directory_ / "session/observer.mkv");
  EXPECT_EQ(run(0), task_status::machine_fault);
  EXPECT_THAT(said(0), StartsWith("machine: "));
  EXPECT_EQ(folder_.read_stopped(), "");
}

TEST_F(FarmTask, ThatMergesNeedsAllSums) {
  divide_samples(2);
  options_.division.chunk = 8;  // a range of all frames
  submit();
  EXPECT_EQ(run(0), task_status::done);
  EXPECT_FALSE(has_picture(0));
  EXPECT_EQ(finish(), task_status::machine_fault);
  EXPECT_THAT(out_.str(), HasSubstr("8 frames are missing"));
  // A sum that was damaged is rendered again.
  write_content(folder_.sums(0, 1) / "0003.sums.exr", "damaged");
  farm::retry(job_options(), out_);
  run_all();
  EXPECT_EQ(run(), task_status::done) << out_.str();
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  expect_pictures_of_one_run(options_.render);
}

// Sums are rendered of those frames only whose pictures are not there yet.
TEST_F(FarmTask, ThatMergesNeedsNoSumsOfAFrameThatIsThere) {
  divide_samples(2);
  post::RenderOptions one = options_.render;
  one.session = directory_ / "session";
  one.frames = {0, 1};
  one.video = false;
  post::render_session(one, out_);
  submit();
  out_.str("");
  run_all();
  EXPECT_THAT(out_.str(), Not(HasSubstr("frame 0:")));
  EXPECT_EQ(finish(), task_status::done) << out_.str();
}

// Folders of the job that lead elsewhere: nothing is written or removed there.
TEST_F(FarmTask, OfAJobWithLinksIsRefused) {
  test::TemporaryDirectory victim;
  write_content(victim / "notes.txt", "mine");
  divide_samples(2);
  submit();
  run_all();
  for (const char* name : {"sums", "state", "log", "set", "sums/0000", "sums/0000/1"}) {
    const std::filesystem::path place = folder_.place(name), kept = directory_ / "kept";
    std::filesystem::rename(place, kept);
    std::filesystem::create_directory_symlink(victim.path(), place);
    EXPECT_EQ(run(0), task_status::job_fault) << name;
    EXPECT_THAT(test::error_of([&] { farm::finish(job_options(), out_); }), HasSubstr("is a link"))
        << name;
    std::filesystem::remove(place);
    std::filesystem::rename(kept, place);
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(victim.path()), {}), 1);
}

// What others have put into a folder of sums stays when the job is complete.
TEST_F(FarmTask, RemovesItsOwnFilesOnly) {
  divide_samples(2);
  submit();
  run_all();
  write_content(folder_.sums(0, 1) / "notes.txt", "mine");
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  EXPECT_EQ(content_of(folder_.sums(0, 1) / "notes.txt"), "mine");
  EXPECT_FALSE(std::filesystem::exists(folder_.sums(0, 2)));
}

// The loop on several machines ends with the last step on each.
TEST_F(FarmTask, IsFinishedByTwoMachinesAtOnce) {
  submit();
  run_all();
  std::ostringstream out;
  int other = -1;
  {
    const std::jthread second([&] { other = farm::finish(job_options(), out); });
    EXPECT_EQ(finish(), task_status::done) << out_.str();
  }
  EXPECT_EQ(other, task_status::done) << out.str();
  EXPECT_FALSE(std::filesystem::exists(folder_.missing_file()));
  EXPECT_EQ(state_of(folder_.read_state(finish_name)), "done: ");
  expect_pictures_of_one_run({});
}

// A process that renders a frame into the folder of pictures.
class OtherProcess {
 public:
  OtherProcess(const std::filesystem::path& pictures, std::uint64_t frame) : locks_(pictures) {
    const post::FolderLocks::Transaction transaction(locks_);
    locks_.join();
    EXPECT_FALSE(locks_.claim({frame}, 1).empty());
  }

 private:
  post::FolderLocks locks_;
};

// A job has one name, by whatever way it is reached.
TEST_F(FarmTask, IsKnownThroughALink) {
  submit();
  std::filesystem::create_directory_symlink(directory_.path(), directory_ / "way");
  EXPECT_EQ(JobFolder(directory_ / "way/job/").name(), folder_.name());
  EXPECT_EQ(JobFolder(directory_ / "way/../job").name(), folder_.name());
}

// After a failure of the network two machines may have one task.
TEST_F(FarmTask, ThatRunsTwiceDoesNoHarm) {
  submit();
  {
    const std::jthread other([&] {
      TaskOptions task;
      task.job = folder_.path();
      task.number = 0;
      std::ostringstream out;
      EXPECT_EQ(run_task(task, this_machine(), out), task_status::done) << out.str();
    });
    EXPECT_EQ(run(0), task_status::done) << out_.str();
  }
  run_all();
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  expect_pictures_of_one_run({});
}

TEST_F(FarmTask, ThatIsAtWorkIsLeftAloneByTheLastStep) {
  submit();
  EXPECT_EQ(run(0), task_status::done);
  const OtherProcess other(directory_ / "out", 4);
  EXPECT_EQ(finish(), task_status::machine_fault);
  EXPECT_THAT(out_.str(), HasSubstr("session: frame 4: is being rendered by previzd"));
}

// A frame that another process has is waited for: that process may die.
TEST_F(FarmTask, TakesOverWhatAnotherDoesNotFinish) {
  submit();
  std::optional<OtherProcess> other(std::in_place, directory_ / "out", 4);
  const std::jthread end([&] {
    EXPECT_TRUE(test::wait_until("all other frames are there",
                                 [&] { return has_picture(7) && has_picture(3); }));
    std::this_thread::sleep_for(std::chrono::seconds(2));  // until the task has looked for more
    EXPECT_FALSE(has_picture(4));
    other.reset();
  });
  EXPECT_EQ(run(), task_status::done) << out_.str();
  EXPECT_TRUE(has_picture(4));
}

// The last step of another machine ends while a task of this one opens its device, and removes the
// sums.
TEST_F(FarmTask, ThatComesTooLateRendersNothing) {
  divide_samples(2);
  submit();
  Machine late = machine_;
  late.open_device = [&](const render::DeviceOptions& options) {
    run_all();
    EXPECT_EQ(finish(), task_status::done) << out_.str();
    out_.str("");
    return machine_.open_device(options);
  };
  TaskOptions task;
  task.job = folder_.path();
  EXPECT_EQ(run_task(task, late, out_), task_status::done) << out_.str();
  EXPECT_THAT(out_.str(), Not(HasSubstr("samples in")));
}

// A retry that finds frames missing takes back what an earlier last step said.
TEST_F(FarmTask, ThatIsToBeRetriedTakesBackThatTheJobIsDone) {
  submit();
  run_all();
  EXPECT_EQ(finish(), task_status::done) << out_.str();
  std::filesystem::remove(directory_ / "out/0004.exr");
  farm::retry(job_options(), out_);
  EXPECT_EQ(state_of(folder_.read_state(finish_name)), "none");
}

TEST_F(FarmTask, OfAnotherKindOfDeviceIsNotTaken) {
  options_.any_device = false;
  options_.on_gpu = render::is_gpu(*machine_.open_device({}));
  submit();
  run_all();
  const std::filesystem::path file = directory_ / "out/frames.jsonl";
  std::string lines = content_of(file);
  const std::string is = options_.on_gpu.value() ? "true" : "false",
                    is_not = is == "true" ? "false" : "true";
  lines.replace(lines.rfind("\"is_gpu\":" + is), 9 + is.size(), "\"is_gpu\":" + is_not);
  write_content(file, lines);
  EXPECT_EQ(finish(), task_status::machine_fault);
  EXPECT_THAT(out_.str(), HasSubstr("session: frame 7: was rendered on "));
  EXPECT_THAT(out_.str(), HasSubstr("--any-device` takes both"));
  EXPECT_EQ(finish(), task_status::machine_fault);  // it is still known
  EXPECT_THAT(out_.str(), HasSubstr("session: frame 7: was rendered on "));
  farm::retry(job_options(), out_);
  EXPECT_EQ(run(0), task_status::done) << out_.str();
  EXPECT_EQ(finish(), task_status::done) << out_.str();
}

TEST_F(FarmTask, OfAnotherKindOfDeviceMayBeTakenLater) {
  options_.any_device = false;
  options_.on_gpu = !render::is_gpu(*machine_.open_device({}));
  submit();
  Job job = folder_.read_plan();
  job.any_device = true;  // so that its tasks run here
  session::replace_file(folder_.plan(), to_json(job));
  run_all();
  job.any_device = false;
  session::replace_file(folder_.plan(), to_json(job));
  EXPECT_EQ(finish(), task_status::machine_fault);
  JobOptions both = job_options();
  both.any_device = true;
  EXPECT_EQ(farm::finish(both, out_), task_status::done) << out_.str();
}

// The job is refused before the night, and not after it.
TEST_F(FarmTask, OfAnotherKindOfDeviceIsRefusedWhereItWasRenderedBefore) {
  post::RenderOptions before = options_.render;
  before.session = directory_ / "session";
  before.frames = post::FrameRange{0, 1};
  post::render_session(before, out_);
  options_.any_device = false;
  options_.on_gpu = !render::is_gpu(*machine_.open_device({}));
  EXPECT_THAT(test::error_of([&] { submit(); }),
              AllOf(HasSubstr("frame 0: was rendered on "), HasSubstr("--force")));
  options_.render.force = true;
  submit();
}

// A plan that came from elsewhere chooses neither a place nor a program.
TEST_F(FarmTask, WritesBesideTheJobOnlyUnlessItIsAllowed) {
  test::TemporaryDirectory elsewhere;
  options_.render.directory = elsewhere / "out";
  submit();
  EXPECT_EQ(run(0), task_status::job_fault);
  EXPECT_THAT(out_.str(), HasSubstr("is not beside the job's folder"));
  EXPECT_THAT(test::error_of([&] { farm::finish(job_options(), out_); }), HasSubstr("--any-paths"));
  EXPECT_FALSE(std::filesystem::exists(elsewhere / "out/0000.exr"));
}

// The same for what it reads: whatever the plan or the set in the job names, nothing beside the
// job's folder and the take is opened.
TEST_F(FarmTask, ReadsInTheJobOnlyUnlessItIsAllowed) {
  const test::TemporaryDirectory elsewhere;
  const std::filesystem::path secret = elsewhere / "secret.toml";
  write_content(secret, "[set]\npassword = 1\n");
  options_.render.set_file = directory_ / "set.toml";
  submit();
  const std::string plan = content_of(folder_.plan());
  const std::filesystem::path set = folder_.place("set/set.toml");
  const auto expect_refused = [&](const std::string& why) {
    out_.str("");
    EXPECT_NE(run(0), task_status::done);
    EXPECT_THAT(out_.str(), AllOf(HasSubstr(why), Not(HasSubstr("password"))));
  };
  const auto name_in_plan = [&](const std::string& place) {
    auto json = nlohmann::ordered_json::parse(plan);
    json["set_file"] = place;
    write_content(folder_.plan(), json.dump());
  };
  std::filesystem::create_directory_symlink(elsewhere.path(), folder_.path() / "evil");
  for (const char* place : {"evil/secret.toml", "state/../evil/secret.toml"}) {
    name_in_plan(place);
    expect_refused("lies outside the job's folder");
  }
  write_content(folder_.plan(), plan);
  const std::string good = content_of(set);
  std::filesystem::remove(set);
  std::filesystem::create_symlink(secret, set);
  expect_refused("is a link");
  std::filesystem::remove(set);
  write_content(elsewhere / "card.gltf", content_of(directory_ / "card.gltf"));
  write_content(set, good + "[[object]]\nname = \"more\"\nfile = \"" +
                         (elsewhere / "card.gltf").string() + "\"\npresence = \"virtual\"\n");
  expect_refused("lies outside the job's folder");
  write_content(set, good);
  EXPECT_EQ(run(0), task_status::done) << out_.str();
}

TEST_F(FarmTask, OfALinkedPlanIsRefused) {
  submit();
  std::filesystem::rename(folder_.plan(), directory_ / "plan.json");
  std::filesystem::create_symlink(directory_ / "plan.json", folder_.plan());
  EXPECT_EQ(run(0), task_status::job_fault);
  EXPECT_THAT(out_.str(), HasSubstr("job.json: is a link"));
}

TEST_F(FarmTask, OfASecondJobInOneFolderIsRefused) {
  submit();
  EXPECT_THAT(test::error_of([&] { submit(); }), HasSubstr("a job is there already"));
}

TEST_F(FarmTask, LeavesOutWhatIsRenderedAlready) {
  post::RenderOptions before = options_.render;
  before.session = directory_ / "session";
  before.frames = post::FrameRange{0, 4};
  std::ostringstream out;
  post::render_session(before, out);
  const auto written = std::filesystem::last_write_time(directory_ / "out/0004.exr");
  submit();
  EXPECT_EQ(run(0), task_status::done);
  EXPECT_EQ(std::filesystem::last_write_time(directory_ / "out/0004.exr"), written);
  EXPECT_TRUE(has_picture(7));
  EXPECT_EQ(finish(), task_status::done) << out_.str();
}

// The plan has no word for each of them, and the last step looks at each once.
TEST_F(FarmTask, OfManyFramesIsPlannedAndProvedInLittleTimeAndSpace) {
  Job job;
  job.takes.emplace_back();
  job.takes[0].session = job.takes[0].pictures = "/a";
  job.takes[0].frames = {0, 99'999};
  job.takes[0].settings = "{}";
  const std::string text = to_json(job);
  EXPECT_LT(text.size(), 2'000u);
  Job read = job_from_json(text, "plan");
  read.takes[0].pictures = directory_ / "out";
  std::filesystem::create_directory(folder_.path());
  EXPECT_EQ(prove(folder_, read, Foreign::keep, out_, {}).missing_frames(), 100'000u);
}

TEST_F(FarmTask, DryRunWritesNothing) {
  options_.dry_run = true;
  submit();
  EXPECT_THAT(out_.str(), AllOf(HasSubstr("\nsbatch --parsable "), HasSubstr(" --array=0-2 ")));
  EXPECT_FALSE(std::filesystem::exists(directory_ / "job"));
  EXPECT_FALSE(std::filesystem::exists(directory_ / "out"));
}

}  // namespace previz::farm::task_test
