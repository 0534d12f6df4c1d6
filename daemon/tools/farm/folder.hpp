// The folder of a job, which all its machines see:
//   JOB/job.json            the plan (Job)
//   JOB/set/                the set file, the overlay and the files that the set names
//   JOB/tasks.sh, finish.sh what the scheduler starts
//   JOB/loop.sh             the same for people without a scheduler
//   JOB/sums/0000/3/        the sums of sample range 3 of the first take, until they are merged
//   JOB/state/0003.json     what a task said last (TaskState), by its number or its machine
//   JOB/state/finish.json   what the last step said last, likewise
//   JOB/log/                a log a task
//   JOB/submitted.txt       the scheduler's numbers of the job; absent: nothing was submitted
//   JOB/stopped.txt         why no further task starts; absent: they do
//   JOB/missing.json        what the last step found missing; absent: nothing, or it has not run
//   JOB/render.lock         lets one process at a time do the last step or a retry (FolderLocks)
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "daemon/tools/farm/job.hpp"

namespace previz::farm {

// What became of a task.
enum class TaskOutcome {
  running,
  done,
  stopped,  // by a signal; what was finished is on disk
  machine,  // the machine is at fault: another one, or a later time, mends it (exit status 75)
  job       // the job is at fault: no machine can do it (exit status 1)
};

struct TaskState {
  TaskOutcome outcome = TaskOutcome::running;
  std::string host;
  std::int64_t pid = 0;
  std::string since;    // "2026-11-28 20:03:11 UTC"
  std::string message;  // one line: why it is not done
};

// Returns what a process says now; `message` is put on one line.
TaskState state_now(TaskOutcome outcome, const std::string& host, const std::string& message);

// The words for an outcome in JOB/state and in `farm status --json`: "running", "done", "stopped",
// "machine", "job".
const char* name_of(TaskOutcome outcome);

// Returns the name by which a task is known: "0003", with at least four digits, or that of its
// machine where nobody numbers tasks.
std::string task_name(std::optional<std::uint64_t> number, const std::string& host);
inline constexpr const char* finish_name = "finish";

class JobFolder {
 public:
  explicit JobFolder(const std::filesystem::path& folder);

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path plan() const { return path_ / "job.json"; }
  std::filesystem::path sums(std::size_t take, int range) const;
  std::filesystem::path task_script() const { return path_ / "tasks.sh"; }
  std::filesystem::path finish_script() const { return path_ / "finish.sh"; }
  std::filesystem::path loop_script() const { return path_ / "loop.sh"; }
  std::filesystem::path submitted_file() const { return path_ / "submitted.txt"; }
  std::filesystem::path stopped_file() const { return path_ / "stopped.txt"; }
  std::filesystem::path missing_file() const { return path_ / "missing.json"; }
  // Returns the place of a file that the plan names.
  std::filesystem::path place(const std::string& in_folder) const { return path_ / in_folder; }

  // Whatever follows reads and replaces plain files only, and throws previz::Error naming the file
  // where another thing is in its place or it cannot be read or written.

  // Throws JobFault if the folder holds no job, and like refuse_links().
  Job read_plan() const;
  // Throws JobFault if one of its own folders is a link, so that files would be written where it
  // leads.
  void refuse_links() const;
  // Returns what a task, or the last step, said last; nothing if it said nothing yet, or half of
  // it.
  std::optional<TaskState> read_state(const std::string& task) const;
  // Returns what all tasks said last, by their names, without the last step.
  std::map<std::string, TaskState> read_states() const;
  void write_state(const std::string& task, const TaskState& state) const;
  // Forgets what an earlier submission has left: states, why it was stopped, what was missing.
  void forget_states() const;
  // Returns why no further task starts; empty: they do.
  std::string read_stopped() const;

  // Returns the options by which the plan renders the frames of a take, into the folder of its
  // pictures.
  post::RenderOptions render_options(const Job& job, const JobTake& take) const;

  // Returns the name by which the scheduler knows the job's parts: "previz-" and eight hexadecimal
  // digits of the folder's hash.
  std::string name() const;

 private:
  std::filesystem::path path_;  // absolute, without links, so that all names of the folder are one
};

}  // namespace previz::farm
