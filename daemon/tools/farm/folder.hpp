// The folder of a job, which all its machines see:
//   JOB/job.json            the plan (Job)
//   JOB/set/                the set file, the overlay and the files that the set names
//   JOB/tasks.sh, finish.sh what the scheduler starts
//   JOB/loop.sh             the same for people without a scheduler
//   JOB/chunks/0003/        a chunk's pictures, as `previz render` leaves them; the last step
//                           moves them into the folder of finished pictures
//   JOB/state/0003.json     what the task of that chunk said last (TaskState); its time is
//                           renewed as long as the task runs (SignsOfLife)
//   JOB/state/finish.json   what the last step, or a retry, said last, likewise
//   JOB/log/                a log a task
//   JOB/submitted.json      the scheduler's numbers of the job
//   JOB/stopped.txt         why no further task starts; absent: they do
//   JOB/job.lock            the last step and a retry lock it (JobLock): one is at work at a time
//   JOB/missing.json        what the last step found missing; absent: nothing, or it has not run
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/tools/farm/job.hpp"
#include "daemon/tools/post/folder_locks.hpp"

namespace previz::farm {

// What became of a task.
enum class TaskOutcome {
  running,
  done,
  stopped,  // by a signal; what was finished is on disk
  machine,  // the machine is at fault: another one, or a later time, mends it (66 and 75)
  job       // the job is at fault: no machine can do it (exit status 1)
};

struct TaskState {
  TaskOutcome outcome = TaskOutcome::running;
  std::string host;
  std::int64_t pid = 0;
  std::string since;    // "2026-11-28 20:03:11 UTC"
  std::string message;  // one line: why it is not done
  bool alone = false;   // its machine has no locks that others see: its signs of life count
};

// Returns what a process says now; `message` is put on one line.
TaskState state_now(TaskOutcome outcome, const std::string& host, const std::string& message);

// The words for an outcome in JOB/state and in `farm status --json`: "running", "done", "stopped",
// "machine", "job".
const char* name_of(TaskOutcome outcome);

// The scheduler's numbers of what was submitted last.
struct Submitted {
  std::vector<std::uint64_t> tasks;     // arrays, in the order of their chunks
  std::optional<std::uint64_t> finish;  // the last step
};

// Tells who is at work on a chunk.
enum class Taken {
  no,
  shared,  // a process with which its frames are shared, by the locks of the file system
  alone    // a machine that has told so, and whose locks are not seen here
};

class JobFolder {
 public:
  using LockCall = post::LockCall;

  explicit JobFolder(const std::filesystem::path& folder);
  // Locks by `call`, which stands for another file system.
  JobFolder(const std::filesystem::path& folder, LockCall call);

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path plan() const { return path_ / "job.json"; }
  std::filesystem::path chunk(std::size_t chunk) const;
  std::filesystem::path task_script() const { return path_ / "tasks.sh"; }
  std::filesystem::path finish_script() const { return path_ / "finish.sh"; }
  std::filesystem::path loop_script() const { return path_ / "loop.sh"; }
  std::filesystem::path stopped_file() const { return path_ / "stopped.txt"; }
  std::filesystem::path missing_file() const { return path_ / "missing.json"; }
  std::filesystem::path state_file(std::size_t chunk) const;
  std::filesystem::path finish_state_file() const { return path_ / "state" / "finish.json"; }
  // Returns the place of a file that the plan names.
  std::filesystem::path place(const std::string& in_folder) const { return path_ / in_folder; }

  // Whatever follows reads and replaces plain files only, and throws previz::Error naming the file
  // where another thing is in its place or it cannot be read or written.

  // Throws JobFault if the folder holds no job, or if one of its own folders is a link, so that
  // files would be written where it leads.
  Job read_plan() const;
  // Returns what the task said last; nothing if it said nothing yet, or half of it.
  std::optional<TaskState> read_state(std::size_t chunk) const;
  void write_state(std::size_t chunk, const TaskState& state) const;
  // The same of the last step, or of a retry.
  std::optional<TaskState> read_finish_state() const;
  void write_finish_state(const TaskState& state) const;
  void remove_finish_state() const;
  Submitted read_submitted() const;
  void write_submitted(const Submitted& submitted) const;
  // Returns why no further task starts; empty: they do.
  std::string read_stopped() const;

  // Returns who is at work on the chunk, on whatever machine.
  Taken taken(std::size_t chunk) const;
  // Returns the process whose last step or retry is known to be at work by its signs of life, and
  // not by locks; nothing if there is none.
  std::optional<TaskState> living_finish() const;
  // Returns whether the file system has locks that other machines see; true where there is no plan
  // by which that could be known.
  bool has_locks() const;
  // Returns by what files are locked: fcntl(2), but in tests.
  LockCall lock_call() const { return call_; }

  // Returns the options by which the plan renders a take, without the frames and the folder for
  // them.
  post::RenderOptions render_options(const Job& job, const JobTake& take) const;

  // Returns the name by which the scheduler knows the job's parts: "previz-" and eight hexadecimal
  // digits of the folder's hash.
  std::string name() const;

 private:
  std::optional<TaskState> read_state_in(const std::filesystem::path& file) const;
  void write_state_in(const std::filesystem::path& file, const TaskState& state) const;
  void refuse_links() const;
  std::optional<TaskState> living(const std::filesystem::path& state_file) const;

  LockCall call_;
  std::filesystem::path path_;  // absolute, without links, so that all names of the folder are one
};

}  // namespace previz::farm
