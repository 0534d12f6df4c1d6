// Renders a chunk of a job, as every task does.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <stop_token>
#include <string>

#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/machine.hpp"

namespace previz::farm {

struct TaskOptions {
  std::filesystem::path job;
  std::size_t chunk = 0;
  // The pictures may lie where the plan says, wherever that is (check_paths()).
  bool any_paths = false;
  // Leaves a chunk alone that another machine is at, or whose sums are not all there; otherwise it
  // waits, and takes over what another one does not finish.
  bool not_if_taken = false;
  std::stop_token stop;
};

// The exit status of a task.
namespace task_status {
inline constexpr int done = 0;
inline constexpr int job_fault = 1;  // no retry mends it
// Those of sysexits.h. EX_NOINPUT: what is to be merged was not rendered, and waiting for it is in
// vain; EX_TEMPFAIL: another machine, or time, does it.
inline constexpr int missing_sums = 66, machine_fault = 75;
}  // namespace task_status

// Throws JobFault if pictures would be written outside of the job's folder and of the one that it
// lies in, or if the takes' own sets might name any file, unless `any_paths`: a plan that came from
// elsewhere does not choose where files are written and read.
void check_paths(const JobFolder& folder, Job& job, bool any_paths);

// Renders what is missing of a chunk into the chunk's own folder. Two tasks with one chunk share
// its frames, or, where the file system has no locks that both see, one waits for the other. What a
// task of the same chunk has finished before is kept if it is whole. All that can be known is
// checked before the first frame, and the outcome is written into the job's folder; `out` gets the
// same line. Returns a status of task_status; a stop counts as done.
int run_task(const TaskOptions& options, const Machine& machine, std::ostream& out);

// Writes down that a signal ended the process `task`, which ran the task, in these words; returns
// the task's status, by which it is tried again.
int end_stopped_task(const TaskOptions& options, const Machine& machine, std::int64_t task,
                     const std::string& words);

}  // namespace previz::farm
