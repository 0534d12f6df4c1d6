#include "daemon/tools/farm/task.hpp"

#include <chrono>
#include <nlohmann/json.hpp>
#include <ostream>
#include <set>
#include <sstream>
#include <thread>

#include "daemon/core/report/printable.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/post/folder_locks.hpp"
#include "daemon/tools/post/render.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "daemon/tools/post/render_plan.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Other machines are left alone for so long before they are looked at again.
constexpr std::chrono::milliseconds while_others_work(3000), between_looks_at_stop(100);

class Task {
 public:
  Task(const TaskOptions& options, const Machine& machine, std::ostream& out)
      : options_(options),
        machine_(machine),
        out_(out),
        folder_(options.job),
        name_(task_name(options.number, machine.host)) {}

  int run();

 private:
  // What came of one look at all takes.
  struct Round {
    std::uint64_t made = 0;  // frames that were rendered or merged here
    std::uint64_t at_others = 0;
  };

  void begin();
  void render();
  bool has_its_share() const { return options_.number && rendered_ >= job_.share; }
  std::uint64_t rest_of_share() const { return job_.share - (options_.number ? rendered_ : 0); }
  bool is_stopped() const { return options_.stop.stop_requested(); }
  void refuse_if_stopped() const;
  post::Frames finished(const JobTake& take) const;
  bool is_complete() const;
  void check(const JobTake& take);
  void render_take(std::size_t index, Round& round);
  void render_ranges(std::size_t index, Round& round);
  void merge(std::size_t index, Round& round);
  std::uint64_t render_some(const JobTake& take, post::RenderOptions options, std::uint64_t most,
                            Round& round);
  void wait() const;
  void say(TaskOutcome outcome, const std::string& message);
  int fail(TaskOutcome outcome, const std::string& message);
  int end_after(const Error& error);

  const TaskOptions& options_;
  const Machine& machine_;
  std::ostream& out_;
  const JobFolder folder_;
  const std::string name_;
  Job job_;
  std::optional<post::FolderLocks> at_work_;  // by which others know that this task lives
  std::set<const JobTake*> checked_;
  std::shared_ptr<render::Device> device_;
  bool has_hardware_rays_ = false;  // what the device was opened for
  std::uint64_t rendered_ = 0;      // of its share
  // Frames of takes that were claimed here and not made: they are not asked for again.
  std::set<std::pair<const JobTake*, std::uint64_t>> unreadable_;
  bool waits_ = false;  // all that is left is at others
};

// Throws JobFault, or previz::Error where another machine may do it.
void Task::begin() {
  Job job = folder_.read_plan();
  check_paths(folder_, job, options_.any_paths);
  refuse_if_stopped();
  job_ = std::move(job);
  out_ << "task " << name_ << " of " << folder_.path().string() << ", on " << machine_.host
       << std::endl;
  say(TaskOutcome::running, "");
  at_work_.emplace(folder_.path());
  const post::FolderLocks::Transaction transaction(*at_work_, options_.stop);
  at_work_->join();
}

void Task::refuse_if_stopped() const {
  if (const std::string why = folder_.read_stopped(); !why.empty())
    throw JobFault("the job was stopped: " + on_one_line(why) + "; `previz farm retry` goes on");
}

post::Frames Task::finished(const JobTake& take) const {
  return post::finished_frames({take.pictures, take.exr, take.png, false}, /*has_sums=*/false,
                               take.frames);
}

bool Task::is_complete() const {
  return std::ranges::all_of(job_.takes, [&](const JobTake& take) {
    return finished(take).size() == length_of(take.frames);
  });
}

void Task::render() {
  // Whoever had a frame may have died after it was asked for, and before it was looked who has it.
  bool has_looked_again = false;
  while (!is_stopped() && !has_its_share()) {
    Round round;
    for (std::size_t take = 0; take < job_.takes.size(); ++take)
      if (!is_stopped() && !has_its_share()) render_take(take, round);
    const bool has_nothing = round.made == 0 && round.at_others == 0;
    if (has_nothing && has_looked_again) return;
    has_looked_again = has_nothing;
    waits_ = round.made == 0;
    if (round.at_others > 0 && waits_) wait();
    refuse_if_stopped();
  }
}

// Throws JobFault if the pictures would not be those of the plan: a file was changed since.
void Task::check(const JobTake& take) {
  if (const std::string why = why_not_here(folder_, job_, take, machine_); !why.empty())
    throw Error(why);
  const post::RenderPlan plan = post::plan_render(folder_.render_options(job_, take));
  const std::string changed =
      post::differences(nlohmann::json::parse(take.settings), nlohmann::json::parse(plan.settings));
  if (!changed.empty())
    throw JobFault(
        take.session.string() +
        ": the take, its set, or a file that it names was changed since the job was made "
        "(" +
        changed + "), so that these frames would differ from the others; make the job again");
  if (!device_ || has_hardware_rays_ != take.hardware_rays)
    device_ = open_wanted_device(job_, take, machine_);
  has_hardware_rays_ = take.hardware_rays;
}

void Task::render_take(std::size_t index, Round& round) {
  const JobTake& take = job_.takes[index];
  if (finished(take).size() == length_of(take.frames)) return;
  if (checked_.insert(&take).second) check(take);
  if (job_.sample_ranges > 1) return render_ranges(index, round);
  post::RenderOptions options = folder_.render_options(job_, take);
  options.video = false;
  options.is_left_out = [&](std::uint64_t frame) { return unreadable_.contains({&take, frame}); };
  rendered_ += render_some(take, options, rest_of_share(), round);
}

// Sums are rendered of those frames only whose pictures are not there yet.
void Task::render_ranges(std::size_t index, Round& round) {
  const JobTake& take = job_.takes[index];
  for (int range = 1; range <= job_.sample_ranges && !has_its_share(); ++range) {
    post::RenderOptions options = folder_.render_options(job_, take);
    options.directory = folder_.sums(index, range);
    options.sample_range = render::SampleRange{range, job_.sample_ranges};
    // What the last step of another machine has finished is known once this process is at work
    // there, and its sums are not removed any more.
    post::Frames pictures;
    options.is_left_out = [&](std::uint64_t frame) {
      if (frame == take.frames.first) pictures = finished(take);
      return pictures.contains(frame) || unreadable_.contains({&take, frame});
    };
    rendered_ += render_some(take, options, rest_of_share(), round);
  }
  merge(index, round);
}

// Merges the frames of which all sums are there. The task that renders the last one finds them all.
void Task::merge(std::size_t index, Round& round) {
  const JobTake& take = job_.takes[index];
  const post::Frames pictures = finished(take);
  post::RenderOptions options = folder_.render_options(job_, take);
  options.video = false;
  std::vector<post::Frames> sums;
  for (int range = 1; range <= job_.sample_ranges; ++range) {
    options.sums_from.push_back(folder_.sums(index, range));
    sums.push_back(post::finished_frames({options.sums_from.back(), true, false, false},
                                         /*has_sums=*/true, take.frames));
  }
  std::set<std::uint64_t> whole;
  for (const auto& one : sums.front()) {
    const auto is_in = [&](const post::Frames& frames) { return frames.contains(one.first); };
    if (!is_in(pictures) && std::ranges::all_of(sums, is_in)) whole.insert(one.first);
  }
  if (whole.empty() || is_stopped()) return;
  options.is_left_out = [&](std::uint64_t frame) { return !whole.contains(frame); };
  render_some(take, options, whole.size(), round);
}

// Renders the first `most` frames that are free, and returns how many that were.
std::uint64_t Task::render_some(const JobTake& take, post::RenderOptions options,
                                std::uint64_t most, Round& round) {
  std::uint64_t made = 0;
  options.share = most;
  options.open_device = device_;
  options.stop = options_.stop;
  options.on_frame = [&](const pipeline::Shot&) { ++made; };
  // Whoever waits has said once for whom.
  std::ostringstream said_again;
  const post::RenderReport report = post::render_session(options, waits_ ? said_again : out_);
  if (made > 0) out_ << said_again.str() << std::flush;
  if (!report.failures.empty())
    throw Error(report.failures.front() + "; `previz farm retry` renders it again");
  for (const std::uint64_t frame : report.not_made) unreadable_.insert({&take, frame});
  round.made += made;
  round.at_others += report.at_others;
  return made;
}

// Another machine tells that it has ended by files alone, for which nothing can wait.
void Task::wait() const {
  const auto end = std::chrono::steady_clock::now() + while_others_work;
  while (!is_stopped() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(between_looks_at_stop);
}

void Task::say(TaskOutcome outcome, const std::string& message) {
  folder_.write_state(name_, state_now(outcome, machine_.host, message));
}

// A word that cannot be written is printed: the disk may be what is at fault.
int Task::fail(TaskOutcome outcome, const std::string& message) {
  out_ << machine_.host << ": " << on_one_line(message) << std::endl;
  const bool stops_the_job = outcome == TaskOutcome::job;
  try {
    const bool was_begun = !job_.takes.empty();
    const bool was_stopped = was_begun && !folder_.read_stopped().empty();
    if (was_begun) say(was_stopped ? TaskOutcome::stopped : outcome, message);
    if (was_begun && stops_the_job && !was_stopped)
      session::replace_file(folder_.stopped_file(),
                            "task " + name_ + ": " + on_one_line(message) + "\n");
  } catch (const Error& error) {
    out_ << error.what() << std::endl;
  }
  return stops_the_job ? task_status::job_fault : task_status::machine_fault;
}

// Ends a task that met an error: what it was to do may have been done meanwhile.
int Task::end_after(const Error& error) {
  try {
    if (!job_.takes.empty() && is_complete()) {
      out_ << "all frames are finished" << std::endl;
      say(TaskOutcome::done, "");
      return task_status::done;
    }
  } catch (const Error& further) {
    out_ << further.what() << std::endl;
  }
  const int status = fail(is_stopped() ? TaskOutcome::stopped : TaskOutcome::machine, error.what());
  return is_stopped() ? task_status::done : status;
}

int Task::run() {
  try {
    begin();
    render();
    say(is_stopped() ? TaskOutcome::stopped : TaskOutcome::done, "");
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
  const std::string name = task_name(options.number, machine.host);
  const std::optional<TaskState> last = folder.read_state(name);
  if (last && last->outcome == TaskOutcome::running && last->host == machine.host &&
      last->pid == task)
    folder.write_state(name, state_now(TaskOutcome::machine, machine.host, words));
  return task_status::machine_fault;
} catch (const std::exception&) {
  return task_status::machine_fault;  // no disk to write it to; the words are in the log
}

}  // namespace previz::farm
