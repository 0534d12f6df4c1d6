// Writes what a scheduler, or a person without one, starts: shell scripts, and the template of an
// Open Job Description.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/job.hpp"

namespace previz::farm {

// What the scripts call, and on what.
struct ScriptPlaces {
  std::filesystem::path program;  // previzd, as it is found on every machine
  std::filesystem::path job;      // the job's folder, absolute
  // The job may write into folders that are not beside its own (see check_paths()).
  bool any_paths = false;
};

// Returns the text as one word of a POSIX shell, whatever is in it.
std::string shell_word(const std::string& text);

// Returns the script of a Slurm array. Each of its tasks runs the same command, which takes frames
// that no other has; the task's number, to which the script's first argument is added, is its name.
// Exit status 75 requeues the task, three times at most, after a wait on the machine that refused
// it, so that a machine that refuses all tasks does not use them all up; a signal during the wait
// ends the task for good. Exit status 1 cancels the tasks that have not begun.
std::string slurm_tasks(const ScriptPlaces& places);
// Returns the script of the last step.
std::string slurm_finish(const ScriptPlaces& places);
// Returns a script that renders with all others that run it until no frame is left, and then does
// the last step. A machine that cannot render leaves the last step to those that can.
std::string shell_loop(const ScriptPlaces& places);

// Returns an Open Job Description template, version 2023-09, in JSON, which is YAML as well: the
// same tasks, with the job's folder as a parameter. Throws previz::Error where the specification
// does not allow the name of a path.
std::string openjd_template(const ScriptPlaces& places, const Job& job, const std::string& name);

// Returns the arguments of sbatch(1) for an array of `count` tasks, whose numbers count from
// `offset`. Those in `more` replace what the job asks for, but not what it is found
// by: name, folder, logs, comment, array and dependencies.
std::vector<std::string> sbatch_arguments(const JobFolder& folder, const Job& job,
                                          std::uint64_t offset, std::uint64_t count,
                                          const std::vector<std::string>& after,
                                          const std::vector<std::string>& more);
// Returns those for the last step, which runs after all of these have ended, however they did.
std::vector<std::string> sbatch_finish_arguments(const JobFolder& folder, const Job& job,
                                                 const std::vector<std::string>& after,
                                                 const std::vector<std::string>& more);

}  // namespace previz::farm
