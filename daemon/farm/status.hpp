// Finds out how a job goes: from the job's folder and the folders of pictures, and from Slurm where
// it is there.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/farm/folder.hpp"
#include "daemon/farm/job.hpp"

namespace previz::farm {

struct ChunkStatus {
  std::uint64_t frames = 0, done = 0;
  bool is_running = false;
  std::string queue;               // squeue's word for its state; empty: it is not in the queue
  std::optional<TaskState> state;  // what its task said last; absent: nothing yet

  // Returns whether a task has ended, or begun on a machine that failed, before all frames were
  // done.
  bool has_failed() const;
};

struct JobStatus {
  std::uint64_t frames = 0, done = 0;
  std::size_t running = 0;          // tasks
  double seconds_a_frame = 0;       // the mean of those that are done; 0: none is
  bool is_queued = false;           // a part of the job is in the queue or runs
  std::string stopped;              // why no further task starts; empty: they do
  std::vector<ChunkStatus> chunks;  // those of the job

  // Returns the time until the frames are done if as many tasks run as now; nothing if that is not
  // known.
  std::optional<double> seconds_left() const;
};

// Looks only at lines and names of files, not into pictures. Throws previz::Error where Slurm does
// not answer, or a folder cannot be read.
JobStatus status_of(const JobFolder& folder, const Job& job);

}  // namespace previz::farm
