#include "daemon/tools/farm/status.hpp"

#include <algorithm>
#include <vector>

#include "daemon/tools/farm/slurm.hpp"
#include "daemon/tools/post/folder_locks.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Where that is not known, nobody is said to be at work.
std::vector<post::FolderUser> users_of(const std::filesystem::path& folder) {
  try {
    return post::users_of(folder);
  } catch (const Error&) {
    return {};
  }
}

// Adds up what is finished of a take.
void count(const JobFolder& folder, const Job& job, std::size_t index, JobStatus& status) {
  const JobTake& take = job.takes[index];
  const auto ranges = static_cast<std::uint64_t>(job.sample_ranges);
  const post::Frames pictures = post::finished_frames({take.pictures, take.exr, take.png, false},
                                                      /*has_sums=*/false, take.frames);
  status.frames += length_of(take.frames);
  status.parts += length_of(take.frames) * ranges;
  status.done += pictures.size();
  status.parts_done += pictures.size() * ranges;
  for (const auto& [frame, finished] : pictures) status.seconds_a_part += finished.render_s;
  for (int range = 1; ranges > 1 && range <= job.sample_ranges; ++range)
    for (const auto& [frame, finished] : post::finished_frames(
             {folder.sums(index, range), true, false, false}, /*has_sums=*/true, take.frames)) {
      status.seconds_a_part += finished.render_s;
      status.parts_done += pictures.contains(frame) ? 0 : 1;
    }
}

// Finds the tasks that are alive, and what they have in hand.
void add_users(const JobFolder& folder, const Job& job, JobStatus& status) {
  const auto task_of = [&](const post::FolderUser& user) -> TaskStatus* {
    for (auto& [name, task] : status.tasks)
      if (task.state && task.state->outcome == TaskOutcome::running &&
          task.state->host == user.host && task.state->pid == user.pid)
        return &task;
    return nullptr;
  };
  for (const post::FolderUser& user : users_of(folder.path()))
    if (TaskStatus* task = task_of(user))
      task->is_running = true;
    else if (user.frames.empty())  // another on that machine has written over its word
      status.tasks[words_of(user)].is_running = true;
  const auto add_frames = [&](const std::filesystem::path& pictures, const std::string& of) {
    for (const post::FolderUser& user : users_of(pictures))
      if (TaskStatus* task = task_of(user); task && !user.frames.empty())
        add_to_list(task->frames, post::frames_words({user.frames.begin(), user.frames.end()}) + of,
                    "; ");
  };
  for (std::size_t index = 0; index < job.takes.size(); ++index) {
    const std::string of = " of " + job.takes[index].session.filename().string();
    add_frames(job.takes[index].pictures, of);
    for (int range = 1; job.sample_ranges > 1 && range <= job.sample_ranges; ++range)
      add_frames(folder.sums(index, range), of + ", sample range " + std::to_string(range));
  }
}

void add_queue(const JobFolder& folder, JobStatus& status) {
  for (const QueuedTask& task : queued_tasks(folder)) {
    status.is_queued = true;
    if (!task.number) {
      status.finish_queue = task.state;
      status.finish_reason = task.reason;
      continue;
    }
    TaskStatus& one = status.tasks[task_name(task.number, "")];
    one.queue = task.state;
    one.node = task.node;
    one.reason = task.reason;
    // A task that a machine has refused holds the machine for a while, and Slurm says that it runs.
    const bool was_refused = one.state && (one.state->outcome == TaskOutcome::machine ||
                                           one.state->outcome == TaskOutcome::job);
    if (task.state == "RUNNING") one.is_running = !was_refused;
    if (task.state == "SUSPENDED") one.is_running = false;
  }
}

}  // namespace

JobStatus status_of(const JobFolder& folder, const Job& job) {
  JobStatus status;
  for (std::size_t take = 0; take < job.takes.size(); ++take) count(folder, job, take, status);
  if (status.parts_done > 0) status.seconds_a_part /= static_cast<double>(status.parts_done);
  for (auto& [name, state] : folder.read_states()) status.tasks[name].state = state;
  add_users(folder, job, status);
  if (was_submitted(folder) && has_slurm()) add_queue(folder, status);
  status.stopped = folder.read_stopped();
  status.finish = folder.read_state(finish_name);
  return status;
}

std::optional<double> JobStatus::seconds_left() const {
  const std::size_t running = count(TaskPhase::running);
  if (running == 0 || parts_done == 0) return std::nullopt;
  return static_cast<double>(parts - parts_done) * seconds_a_part / static_cast<double>(running);
}

std::size_t JobStatus::count(TaskPhase phase) const {
  return static_cast<std::size_t>(
      std::ranges::count_if(tasks, [&](const auto& task) { return task.second.phase() == phase; }));
}

bool JobStatus::is_complete() const {
  return done == frames && finish_queue.empty() && finish && finish->outcome == TaskOutcome::done;
}

TaskPhase TaskStatus::phase() const {
  if (is_running) return TaskPhase::running;
  if (queue == "COMPLETING" && state && state->outcome == TaskOutcome::done) return TaskPhase::done;
  const bool is_ending = queue == "RUNNING" && state && state->outcome == TaskOutcome::job;
  if (!queue.empty() && !is_ending)
    return state && !state->message.empty() ? TaskPhase::again : TaskPhase::waiting;
  return state && state->outcome == TaskOutcome::done ? TaskPhase::done : TaskPhase::failed;
}

}  // namespace previz::farm
