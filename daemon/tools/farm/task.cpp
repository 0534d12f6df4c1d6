#include "daemon/tools/farm/task.hpp"

#include <unistd.h>

#include <chrono>
#include <map>
#include <optional>
#include <ostream>
#include <thread>
#include <utility>

#include "daemon/core/report/printable.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/farm/settings.hpp"
#include "daemon/tools/farm/signs_of_life.hpp"
#include "daemon/tools/post/render.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Another machine is left alone for so long before it is looked at again.
constexpr std::chrono::seconds while_another_works(3);

// The sums that a task merges are not rendered.
class MissingSums : public Error {
 public:
  using Error::Error;
};

class Task {
 public:
  Task(const TaskOptions& options, const Machine& machine, std::ostream& out)
      : options_(options), machine_(machine), out_(out), folder_(options.job) {}

  int run();

 private:
  bool begin();
  void refuse_if_stopped() const;
  bool has_my_claim() const;
  bool is_at_another() const;
  bool is_mine_to_render();
  bool is_rendered() const;
  bool take();
  void wait(std::chrono::seconds time) const;
  void read_finished();
  std::string why_nothing_to_merge() const;
  bool is_complete();
  void render();
  post::RenderOptions render_options();
  void check_settings() const;
  void say(TaskOutcome outcome, const std::string& message);
  int fail(TaskOutcome outcome, const std::string& message);
  int end_after(const Error& error);

  const TaskOptions& options_;
  const Machine& machine_;
  std::ostream& out_;
  const JobFolder folder_;
  Job job_;
  Chunk chunk_;
  std::shared_ptr<render::Device> device_;
  std::map<std::uint64_t, post::FinishedFrame> finished_;  // among the finished pictures
  std::optional<SignsOfLife> signs_;
  bool is_known_ = false;  // the chunk is that of the plan
};

// Returns false where there is nothing to do, or another machine is at the chunk and is to be left
// alone. Throws JobFault, or previz::Error where another machine may do it.
bool Task::begin() {
  job_ = folder_.read_plan();
  if (options_.chunk >= job_.chunks.size())
    throw JobFault(folder_.plan().string() + ": has no chunk " + std::to_string(options_.chunk) +
                   "; the last one is " + std::to_string(job_.chunks.size() - 1));
  chunk_ = job_.chunks[options_.chunk];
  check_paths(folder_, job_, options_.any_paths);
  refuse_if_stopped();
  out_ << "chunk " << options_.chunk << ": " << on_one_line(words_of(job_, chunk_)) << ", on "
       << machine_.host << std::endl;
  is_known_ = true;
  if (const std::string why = why_not_here(folder_, job_, chunk_, machine_); !why.empty())
    throw Error(why);
  while (!is_complete()) {
    if (!is_mine_to_render()) return false;
    refuse_if_stopped();  // while it waited
    if (!take()) continue;
    if (const std::string why = why_nothing_to_merge(); !why.empty()) throw MissingSums(why);
    device_ = open_wanted_device(job_, job_.takes[chunk_.take], machine_);
    return true;
  }
  return false;
}

void Task::refuse_if_stopped() const {
  if (const std::string why = folder_.read_stopped(); !why.empty())
    throw JobFault("the job was stopped: " + on_one_line(why) + "; `previz farm retry` goes on");
}

// Returns whether the chunk's state says that this process renders it.
bool Task::has_my_claim() const {
  const std::optional<TaskState> state = folder_.read_state(options_.chunk);
  return state && state->outcome == TaskOutcome::running && state->host == machine_.host &&
         state->pid == ::getpid();
}

// Returns whether another process is at the chunk, while this one renders nothing.
bool Task::is_at_another() const {
  const Taken taken = folder_.taken(options_.chunk);
  return taken == Taken::shared || (taken == Taken::alone && !has_my_claim());
}

// Returns whether the chunk is to be rendered here. Waits for a machine that is at it, unless it is
// to be left alone, or its frames can be shared.
bool Task::is_mine_to_render() {
  if (options_.not_if_taken && is_at_another()) {
    out_ << "another machine is rendering it" << std::endl;
    return false;
  }
  if (options_.not_if_taken && !why_nothing_to_merge().empty()) {
    out_ << "the sums that are merged in it are not all there yet; left for later" << std::endl;
    return false;
  }
  bool is_told = false;
  for (; folder_.taken(options_.chunk) == Taken::alone; wait(while_another_works)) {
    const std::optional<TaskState> state = folder_.read_state(options_.chunk);
    if (!std::exchange(is_told, true) && state)
      out_ << on_one_line("waits for " + state->host + ", which has begun it at " + state->since)
           << ": the disk has no locks by which they could share its frames. If that machine has "
              "died, it is taken over within three minutes"
           << std::endl;
  }
  return true;
}

// Returns whether the chunk's own folder has all of its frames, so that there is little to do.
bool Task::is_rendered() const {
  const JobTake& take = job_.takes[chunk_.take];
  const bool is_sums = chunk_.kind == ChunkKind::sums;
  const auto there = post::finished_frames(
      {folder_.chunk(options_.chunk), take.exr, take.png, false}, is_sums, chunk_.frames);
  return there.size() == length_of(chunk_.frames);
}

// Takes the chunk. Returns false if another machine has done so at the same moment, where no lock
// tells.
bool Task::take() {
  say(TaskOutcome::running, "");
  if (!folder_.has_locks() && !is_rendered()) {
    wait(for_another_to_tell);
    if (!has_my_claim()) return false;
  }
  signs_.emplace(folder_.state_file(options_.chunk));
  return true;
}

// Another machine tells that it has ended by files alone, for which nothing can wait.
void Task::wait(std::chrono::seconds time) const {
  if (options_.stop.stop_requested()) throw Error("interrupted while another machine rendered it");
  std::this_thread::sleep_for(time);
}

void Task::read_finished() {
  const JobTake& take = job_.takes[chunk_.take];
  finished_ = post::finished_frames({take.pictures, take.exr, take.png, false}, /*has_sums=*/false,
                                    chunk_.frames);
}

// Returns which of the sums that this task merges are not there; empty: all are.
std::string Task::why_nothing_to_merge() const {
  for (std::size_t other = 0; chunk_.kind == ChunkKind::merge && other < options_.chunk; ++other) {
    if (!is_merged_of(job_, options_.chunk, other)) continue;
    const Chunk& part = job_.chunks[other];
    const auto there = post::finished_frames({folder_.chunk(other), true, false, false},
                                             /*has_sums=*/true, part.frames);
    for (std::uint64_t frame = part.frames.first; frame <= part.frames.last; ++frame)
      if (!there.contains(frame) && !finished_.contains(frame))
        return "chunk " + std::to_string(other) + " (" + words_of(job_, part) +
               ") is not rendered, so that there is nothing to merge; `previz farm retry` renders "
               "it";
  }
  return "";
}

post::RenderOptions Task::render_options() {
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
  options.is_elsewhere = [this](std::uint64_t frame) {
    // The last step of another machine may have moved them since.
    if (frame == chunk_.frames.first) read_finished();
    return finished_.contains(frame);
  };
  return options;
}

// Throws JobFault if the pictures would not be those of the plan: a file was changed since.
void Task::check_settings() const {
  const std::filesystem::path file = folder_.chunk(options_.chunk) / "render.json";
  const std::string settings = post::read_settings(folder_.chunk(options_.chunk));
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

// Writes what became of the task, but over no word of another process that is at the chunk.
void Task::say(TaskOutcome outcome, const std::string& message) {
  if (outcome != TaskOutcome::running && is_at_another()) return;
  folder_.write_state(options_.chunk, state_now(outcome, machine_.host, message));
}

// A word that cannot be written is printed: the disk may be what is at fault.
int Task::fail(TaskOutcome outcome, const std::string& message) {
  out_ << machine_.host << ": " << on_one_line(message) << std::endl;
  try {
    if (is_known_) say(outcome, message);
    if (is_known_ && outcome == TaskOutcome::job)
      session::replace_file(folder_.stopped_file(), "chunk " + std::to_string(options_.chunk) +
                                                        ": " + on_one_line(message) + "\n");
  } catch (const Error& error) {
    out_ << error.what() << std::endl;
  }
  return outcome == TaskOutcome::job ? task_status::job_fault : task_status::machine_fault;
}

// Returns whether all of the chunk's pictures are where the last step puts them, and says so. It
// removes the folders of chunks, which a task may be about to read.
bool Task::is_complete() {
  read_finished();
  if (finished_.size() < length_of(chunk_.frames)) return false;
  out_ << "these frames are finished already, in " << job_.takes[chunk_.take].pictures.string()
       << std::endl;
  return true;
}

// Ends a task that met an error: what it was to do may have been done meanwhile.
int Task::end_after(const Error& error) {
  try {
    if (is_known_ && is_complete()) {
      say(TaskOutcome::done, "");
      return task_status::done;
    }
  } catch (const Error& further) {
    out_ << further.what() << std::endl;
  }
  const bool was_stopped = options_.stop.stop_requested();
  fail(was_stopped ? TaskOutcome::stopped : TaskOutcome::machine, error.what());
  if (was_stopped) return task_status::done;
  return dynamic_cast<const MissingSums*>(&error) ? task_status::missing_sums
                                                  : task_status::machine_fault;
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
    return end_after(error);
  } catch (const std::exception& error) {  // of a folder that another machine removes
    return end_after(Error(error.what()));
  }
}

}  // namespace

void check_paths(const JobFolder& folder, Job& job, bool any_paths) {
  if (any_paths) job.render.of_set_file = set::Origin::crew;
  if (any_paths) return;
  const std::string mine = "; if the job is yours, allow it with --any-paths";
  for (const JobTake& take : job.takes)
    if (!session::lies_within(folder.path().parent_path(), take.pictures))
      throw JobFault(folder.plan().string() + ": the pictures would be written to " +
                     take.pictures.string() + ", which is not beside the job's folder" + mine);
  std::vector<std::string> places;
  for (const auto& [name, place] : job.set_assets) places.push_back(place);
  if (!job.set_file.empty()) places.push_back(job.set_file);
  if (!job.with_file.empty()) places.push_back(job.with_file);
  for (const std::string& place : places) {
    const std::filesystem::path file = folder.place(place);
    if (const std::string why = session::why_not_plain(file); !why.empty())
      throw JobFault(file.string() + ": " + why + mine);
    if (!session::lies_within(folder.path(), file))
      throw JobFault(file.string() + ": lies outside the job's folder, and is not read" + mine);
  }
  if (job.render.any_paths)
    throw JobFault(folder.plan().string() +
                   ": the takes' own sets may name files outside of the takes" + mine);
}

int run_task(const TaskOptions& options, const Machine& machine, std::ostream& out) {
  return Task(options, machine, out).run();
}

int end_stopped_task(const TaskOptions& options, const Machine& machine, std::int64_t task,
                     const std::string& words) try {
  const JobFolder folder(options.job);
  folder.read_plan();  // refuses links
  const std::optional<TaskState> last = folder.read_state(options.chunk);
  if (last && last->outcome == TaskOutcome::running && last->host == machine.host &&
      last->pid == task)
    folder.write_state(options.chunk, state_now(TaskOutcome::machine, machine.host, words));
  return task_status::machine_fault;
} catch (const std::exception&) {
  return task_status::machine_fault;  // no disk to write it to; the words are in the log
}

}  // namespace previz::farm
