// The last step of a job: proves that every frame is there and whole, and completes what goes
// beside them.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/tools/farm/options.hpp"
#include "daemon/tools/post/folder_locks.hpp"

namespace previz::farm {

// Frames of a take that are missing, and why.
struct MissingFrames {
  std::size_t take = 0;
  std::vector<std::uint64_t> frames;
  std::string why;
};

// What becomes of frames that another kind of device rendered, where the plan does not allow it:
// they are missing and stay where they are, or are forgotten, so that a task renders them again, or
// the job is refused.
enum class Foreign { keep, forget, refuse };

struct Proof {
  std::vector<MissingFrames> missing;
  // Remarks that stop nothing: pictures of several models of graphics cards.
  std::vector<std::string> notes;

  std::uint64_t missing_frames() const;
};

// Looks at every file of every frame, by the SHA-256 in its line; what is not whole is no longer
// finished, nor are sums of frames that are missing. Frames that a process is rendering and, unless
// the plan allows it, those of another kind of device are missing. Throws previz::Error where a
// folder cannot be read or written, on a stop, or for Foreign::refuse.
Proof prove(const JobFolder& folder, const Job& job, Foreign foreign, std::ostream& out,
            const std::stop_token& stop);

// Writes the review videos of the takes and removes the sums that were merged.
void complete(const JobFolder& folder, const Job& job, std::ostream& out);

// Writes JOB/missing.json, or removes it if nothing is missing.
void write_missing(const JobFolder& folder, const Job& job, const Proof& proof);
// Prints what is missing, a line a reason.
void print_missing(const JobFolder& folder, const Job& job, const Proof& proof, std::ostream& out);

// As long as it lives, no other process does the last step of the job, or a retry.
class JobLock {
 public:
  // Waits until no other process has it, and says so; throws previz::Error on a stop.
  JobLock(const JobFolder& folder, std::ostream& out, const std::stop_token& stop);

  // Returns whether another process had it first.
  bool has_waited() const { return has_waited_; }

 private:
  post::FolderLocks locks_;
  bool has_waited_ = false;
};

// Does the last step: proves the frames, and completes the job if none is missing. JOB/state says
// how it ends. Returns a status of task_status; throws JobFault.
int finish(const JobOptions& options, std::ostream& out);

}  // namespace previz::farm
