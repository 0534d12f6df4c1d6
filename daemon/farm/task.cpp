#include "daemon/farm/task.hpp"

#include <chrono>
#include <map>
#include <ostream>
#include <thread>
#include <utility>

#include "daemon/farm/on_one_line.hpp"
#include "daemon/farm/settings.hpp"
#include "daemon/post/render.hpp"
#include "daemon/post/render_files.hpp"
#include "drivers/error.hpp"
#include "drivers/session/draft.hpp"
#include "drivers/session/files.hpp"

namespace previz::farm {
namespace {

// How long another machine is left alone before it is looked at again.
constexpr std::chrono::seconds while_another_works(3);

class Task {
 public:
  Task(const TaskOptions& options, const Machine& machine, std::ostream& out)
      : options_(options), machine_(machine), out_(out), folder_(options.job) {}

  int run();

 private:
  bool begin();
  void check_sums() const;
  void render();
  post::RenderOptions render_options() const;
  void check_settings() const;
  void say(TaskOutcome outcome, const std::string& message);
  int fail(TaskOutcome outcome, const std::string& message);

  const TaskOptions& options_;
  const Machine& machine_;
  std::ostream& out_;
  const JobFolder folder_;
  Job job_;
  Chunk chunk_;
  std::shared_ptr<render::Device> device_;
  std::map<std::uint64_t, post::FinishedFrame> finished_;  // among the finished pictures
  bool is_mine_ = false;  // the chunk is known, and its state is this task's to write
};

// Returns false where another machine is at the chunk, and is to be left alone. Throws JobFault, or
// previz::Error where another machine may do it.
bool Task::begin() {
  job_ = folder_.read_plan();
  if (options_.chunk >= job_.chunks.size())
    throw JobFault(folder_.plan().string() + ": has no chunk " + std::to_string(options_.chunk) +
                   "; the last one is " + std::to_string(job_.chunks.size() - 1));
  chunk_ = job_.chunks[options_.chunk];
  check_paths(folder_, job_, options_.any_paths);
  if (const std::string why = folder_.read_stopped(); !why.empty())
    throw JobFault("the job was stopped: " + on_one_line(why) + "; `previzd farm retry` goes on");
  out_ << "chunk " << options_.chunk << ": " << on_one_line(words_of(job_, chunk_)) << ", on "
       << machine_.host << std::endl;
  if (options_.not_if_taken && folder_.is_taken(options_.chunk)) {
    out_ << "another machine is rendering it" << std::endl;
    return false;
  }
  is_mine_ = true;
  say(TaskOutcome::running, "");
  const std::string why =
      why_not_here(folder_, job_, chunk_, machine_, folder_.state_file(options_.chunk));
  if (!why.empty()) throw Error(why);
  check_sums();
  const JobTake& take = job_.takes[chunk_.take];
  device_ = open_wanted_device(job_, take, machine_);
  finished_ = post::finished_frames({take.pictures, take.exr, take.png, false},
                                    /*has_sums=*/false, chunk_.frames);
  return true;
}

// Throws unless the sums are there that this task merges.
void Task::check_sums() const {
  for (std::size_t other = 0; chunk_.kind == ChunkKind::merge && other < options_.chunk; ++other) {
    if (!is_merged_of(job_, options_.chunk, other)) continue;
    const Chunk& part = job_.chunks[other];
    const auto there = post::finished_frames({folder_.chunk(other), true, false, false},
                                             /*has_sums=*/true, part.frames);
    if (there.size() <= part.frames.last - part.frames.first)
      throw Error("chunk " + std::to_string(other) + " (" + words_of(job_, part) +
                  ") is not rendered, so that there is nothing to merge; `previzd farm retry` "
                  "renders it");
  }
}

post::RenderOptions Task::render_options() const {
  post::RenderOptions options = folder_.render_options(job_, job_.takes[chunk_.take]);
  options.frames = chunk_.frames;
  options.directory = folder_.chunk(options_.chunk);
  options.video = false;
  if (chunk_.kind == ChunkKind::sums)
    options.sample_range = render::SampleRange{chunk_.range, job_.sample_ranges};
  if (chunk_.kind == ChunkKind::merge)
    for (std::size_t other = 0; other < options_.chunk; ++other)
      if (is_merged_of(job_, options_.chunk, other))
        options.sums_from.push_back(folder_.chunk(other));
  options.open_device = device_;
  options.stop = options_.stop;
  options.is_elsewhere = [this](std::uint64_t frame) { return finished_.contains(frame); };
  return options;
}

// Throws JobFault if the pictures would not be those of the plan: a file was changed since.
void Task::check_settings() const {
  const std::filesystem::path file = folder_.chunk(options_.chunk) / "render.json";
  const std::string settings = session::read_plain_file(file);
  const JobTake& take = job_.takes[chunk_.take];
  if (same_settings(settings, take.settings)) return;
  throw JobFault(take.session.string() +
                 ": the take, its set, or a file that it names was changed "
                 "since the job was made (" +
                 difference_words(settings, take.settings) +
                 "), so that these frames would differ from the others; make the job again");
}

void Task::render() {
  post::RenderOptions options = render_options();
  options.on_begin = [this] { check_settings(); };
  for (;;) {
    const post::RenderReport report = post::render_session(options, out_);
    if (!report.failures.empty()) throw Error(report.failures.front());
    if (report.at_others == 0 || report.interrupted || options_.not_if_taken) return;
    std::this_thread::sleep_for(while_another_works);
  }
}

void Task::say(TaskOutcome outcome, const std::string& message) {
  folder_.write_state(options_.chunk, state_now(outcome, machine_.host, message));
}

// The disk may be what is at fault.
int Task::fail(TaskOutcome outcome, const std::string& message) {
  out_ << machine_.host << ": " << on_one_line(message) << std::endl;
  try {
    if (is_mine_) say(outcome, message);
    if (is_mine_ && outcome == TaskOutcome::job)
      session::replace_file(folder_.stopped_file(), "chunk " + std::to_string(options_.chunk) +
                                                        ": " + on_one_line(message) + "\n");
  } catch (const Error& error) {
    out_ << error.what() << std::endl;
  }
  return outcome == TaskOutcome::job ? task_status::job_fault : task_status::machine_fault;
}

int Task::run() {
  try {
    if (!begin()) return task_status::done;
    render();
    say(options_.stop.stop_requested() ? TaskOutcome::stopped : TaskOutcome::done, "");
    return task_status::done;
  } catch (const JobFault& error) {
    return fail(TaskOutcome::job, error.what());
  } catch (const Error& error) {
    if (!options_.stop.stop_requested()) return fail(TaskOutcome::machine, error.what());
    fail(TaskOutcome::stopped, error.what());
    return task_status::done;
  }
}

}  // namespace

void check_paths(const JobFolder& folder, const Job& job, bool any_paths) {
  if (any_paths) return;
  const std::string mine = "; if the job is yours, allow it with --any-paths";
  for (const JobTake& take : job.takes)
    if (!session::lies_within(folder.path().parent_path(), take.pictures))
      throw JobFault(folder.plan().string() + ": the pictures would be written to " +
                     take.pictures.string() + ", which is not beside the job's folder" + mine);
  if (job.render.any_paths)
    throw JobFault(folder.plan().string() +
                   ": the takes' own sets may name files outside of the takes" + mine);
}

int run_task(const TaskOptions& options, const Machine& machine, std::ostream& out) {
  return Task(options, machine, out).run();
}

}  // namespace previz::farm
