// Speaks with Slurm by its programs: sbatch, squeue, scontrol, scancel.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/job.hpp"
#include "daemon/tools/farm/scripts.hpp"

namespace previz::farm {

bool has_slurm();

// Submits so many tasks, by the scripts in the folder, as arrays, and the last step after all of
// them, and writes each number into the job's folder as soon as it is known; prints them. Where the
// job limits how many tasks run at once, an array begins when the one before it has ended. Throws
// previz::Error with sbatch's own words if one is refused; those before it are then cancelled, or
// the error says that they cannot be.
void submit_tasks(const JobFolder& folder, const Job& job, std::uint64_t tasks,
                  const std::vector<std::string>& more, std::ostream& out);
// Writes the scripts into the job's folder.
void write_scripts(const JobFolder& folder, const ScriptPlaces& places);
// Prints the scripts and the commands that submit_tasks() would write and run.
void print_submission(const JobFolder& folder, const Job& job, const ScriptPlaces& places,
                      const std::vector<std::string>& more, std::ostream& out);

// A part of a job in the queue.
struct QueuedTask {
  std::optional<std::uint64_t> number;  // absent: the last step
  std::string state;                    // as squeue(1) has it: "RUNNING", "PENDING"
  std::string node, reason;  // as well: "node2", "DependencyNeverSatisfied"; may be empty
};
// Returns whether the job, or a part of it, was handed to Slurm.
bool was_submitted(const JobFolder& folder);
// Returns what is in the queue or runs under the job's name. Throws previz::Error where Slurm does
// not answer.
std::vector<QueuedTask> queued_tasks(const JobFolder& folder);
// Cancels what is in the queue or runs under the job's name. Throws previz::Error where Slurm does
// not answer or refuses.
void cancel_tasks(const JobFolder& folder);

}  // namespace previz::farm
