// Renders a part of a job, as every task does.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/machine.hpp"

namespace previz::farm {

struct TaskOptions {
  std::filesystem::path job;
  // The task's number. A task that has one ends with its share (Job::share); one without renders
  // until no frame is left, and waits for those that others have.
  std::optional<std::uint64_t> number;
  // The pictures may lie where the plan says, wherever that is (check_paths()).
  bool any_paths = false;
  std::stop_token stop;
};

// The exit status of a task.
namespace task_status {
inline constexpr int done = 0;
inline constexpr int job_fault = 1;  // no retry mends it
inline constexpr int machine_fault =
    75;  // EX_TEMPFAIL of sysexits.h: another machine, or time, does
}  // namespace task_status

// Throws JobFault if pictures would be written outside of the job's folder and of the one that it
// lies in, or if the takes' own sets might name any file, unless `any_paths`: a plan that came from
// elsewhere does not choose where files are written and read.
void check_paths(const JobFolder& folder, Job& job, bool any_paths);

// Renders frames of the job that no other process has finished or is rendering, and merges sample
// ranges of which all are there. Frames that another process has, which may die, are waited for
// while its share is not done. All that can be known is checked before the first frame, and the
// outcome is written into the job's folder; `out` gets the same line. Returns a status of
// task_status; a stop counts as done.
int run_task(const TaskOptions& options, const Machine& machine, std::ostream& out);

// Writes down that a signal ended the process `task`, which ran the task, in these words; returns
// the task's status, by which it is tried again.
int end_stopped_task(const TaskOptions& options, const Machine& machine, std::int64_t task,
                     const std::string& words);

}  // namespace previz::farm
