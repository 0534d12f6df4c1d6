// The last step of a job: moves what the tasks have made into the folder of finished pictures, and
// proves that every frame is there and whole.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/job.hpp"

namespace previz::farm {

// Frames of a take that are missing, and why.
struct MissingFrames {
  std::size_t take = 0;
  std::vector<std::uint64_t> frames;
  std::string why;
};

// What becomes of frames that another kind of device rendered, where the plan does not allow it:
// they stay where they are, or are forgotten, so that a task renders them again.
enum class Foreign { keep, forget };

struct Proof {
  std::vector<MissingFrames> missing;
  std::set<std::size_t> chunks;  // that have a missing frame, and those that they are merged of
  // Remarks that stop nothing: pictures of several models of graphics cards.
  std::vector<std::string> notes;
};

// Looks at every file of every frame, by the SHA-256 in its line; what is not whole is no longer
// finished. Chunks that a process is at stay as they are, and so do frames of other settings, of
// another version or, unless the plan allows it, of another kind of device: these are missing. A
// process that only looks at a chunk whose frames are all there is waited for.
// Throws previz::Error where a folder cannot be read or written, or on a stop.
Proof prove(const JobFolder& folder, const Job& job, Foreign foreign, std::ostream& out,
            const std::stop_token& stop);

// Writes the review videos of the takes and removes what is left of the chunks, but of those that a
// process is at: it finds them finished, and in the loop removes them with its own last step.
void complete(const JobFolder& folder, const Job& job, std::ostream& out);

// Writes JOB/missing.json, or removes it if nothing is missing.
void write_missing(const JobFolder& folder, const Job& job, const Proof& proof);
// Prints what is missing, a line a reason.
void print_missing(const JobFolder& folder, const Job& job, const Proof& proof, std::ostream& out);

// Does the whole last step, within a JobLock: proves the frames, and completes the job if none is
// missing. Returns a status of task_status, or throws as prove() does.
int run_finish(const JobFolder& folder, const Job& job, std::ostream& out,
               const std::stop_token& stop);

}  // namespace previz::farm
