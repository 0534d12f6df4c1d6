// Finds out how a job goes: from the job's folder and the folders of pictures, and from Slurm where
// it is there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>

#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/job.hpp"

namespace previz::farm {

// How it stands with a task.
enum class TaskPhase {
  waiting,  // it is in the queue
  again,    // a machine has refused it, and it is or will be in the queue again
  running,
  failed,  // it has ended otherwise than done, and is not in the queue
  done
};

struct TaskStatus {
  bool is_running = false;
  std::string queue;               // squeue's word for its state; empty: it is not in the queue
  std::optional<TaskState> state;  // what it said last; absent: nothing yet
  std::string node, reason;        // squeue's words: where it runs, why it waits; may be empty
  std::string frames;              // that it has in hand, "frames 3, 4 of 12A"; may be empty

  TaskPhase phase() const;
};

struct JobStatus {
  std::uint64_t frames = 0, done = 0;
  std::uint64_t parts = 0, parts_done = 0;  // frames, or sample ranges of frames
  double seconds_a_part = 0;                // the mean of those that are done; 0: none is
  bool is_queued = false;                   // a part of the job is in the queue or runs
  std::string stopped;                      // why no further task starts; empty: they do
  std::map<std::string, TaskStatus> tasks;  // by task_name()
  std::string finish_queue;                 // squeue's word for the last step; empty: not there
  std::string finish_reason;                // why it waits; may be empty
  std::optional<TaskState> finish;          // what the last step said last; absent: nothing yet

  // Returns the time until the frames are done if as many tasks run as now; nothing if that is not
  // known.
  std::optional<double> seconds_left() const;
  // Returns the number of tasks in this phase.
  std::size_t count(TaskPhase phase) const;
  // Returns whether all frames are done, and the last step as well.
  bool is_complete() const;
};

// Looks only at lines and names of files, not into pictures. Throws previz::Error where Slurm does
// not answer, or a folder cannot be read.
JobStatus status_of(const JobFolder& folder, const Job& job);

// Prints the status in words: how many frames are done, which tasks run, wait again or have failed,
// where and why, and what is to be done. `terminal`: `out` is one.
void print_words(const JobFolder& folder, const Job& job, const JobStatus& status, bool terminal,
                 std::ostream& out);
// Prints the status as JSON, as `previz farm status --json` does.
void print_json(const JobStatus& status, std::ostream& out);

}  // namespace previz::farm
