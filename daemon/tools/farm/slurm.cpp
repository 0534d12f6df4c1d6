#include "daemon/tools/farm/slurm.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <exception>
#include <filesystem>
#include <functional>
#include <ostream>
#include <sstream>

#include "daemon/core/session/draft.hpp"
#include "daemon/tools/farm/program.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Slurm allows so many where slurm.conf says nothing: the highest number of a task is one less.
constexpr std::size_t usual_array_size = 1001;

std::optional<std::uint64_t> number_in(const std::string& text) {
  std::uint64_t number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (code != std::errc() || end == text.data()) return std::nullopt;
  return number;
}

// Returns how many numbers an array may have.
std::size_t array_size() {
  // Where there is no cluster to be asked, it looks for one for half a minute.
  const ProgramResult config = run_program("scontrol", {"show", "config"}, std::chrono::seconds(5));
  std::istringstream lines(config.out);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("MaxArraySize")) continue;
    const std::size_t value = line.find_first_of("0123456789");
    if (value == std::string::npos) break;
    if (const auto size = number_in(line.substr(value)); size && *size > 0) return *size;
  }
  return usual_array_size;
}

std::string quoted_command(const std::vector<std::string>& arguments) {
  std::string text = "sbatch";
  for (const std::string& argument : arguments)
    text += " " + (argument.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                              "0123456789-_=./:,%+") == std::string::npos
                       ? argument
                       : shell_word(argument));
  return text;
}

// Hands over one job with these arguments of sbatch, and returns the name by which others wait for
// it.
using Submit =
    std::function<std::string(const char* about, const std::vector<std::string>& arguments)>;

// Hands over the arrays of so many tasks, and then the last step.
void for_each_job(const JobFolder& folder, const Job& job, std::uint64_t tasks,
                  const std::vector<std::string>& more, const Submit& submit) {
  const std::uint64_t size = array_size();
  std::vector<std::string> all;
  for (std::uint64_t offset = 0; offset < tasks; offset += size) {
    std::vector<std::string> after;
    // Slurm limits each array by itself.
    if (job.wishes.at_once > 0 && !all.empty()) after.push_back(all.back());
    all.push_back(submit("render", sbatch_arguments(folder, job, offset,
                                                    std::min(size, tasks - offset), after, more)));
  }
  submit("check", sbatch_finish_arguments(folder, job, all, more));
}

// Returns the number of the job that sbatch has taken.
std::uint64_t submit_one(const std::vector<std::string>& arguments) {
  const ProgramResult result = run_program("sbatch", arguments);
  if (!result.is_good()) throw Error("sbatch does not take the job: " + result.why());
  if (const std::optional<std::uint64_t> number = number_in(result.out)) return *number;
  throw Error("sbatch does not take the job: it prints no number, but: " + result.out);
}

// Cancels by the job's name: an sbatch that gave no answer may have submitted its part, too.
[[noreturn]] void take_back(const JobFolder& folder, const std::string& why) {
  std::string fault;
  try {
    cancel_tasks(folder);
  } catch (const Error& error) {
    fault = error.what();
  }
  if (!fault.empty())
    throw Error(why + "; a part may be in the queue already, and " + fault +
                "; run `scancel --name=" + folder.name() + "`");
  std::error_code stays;
  std::filesystem::remove(folder.submitted_file(), stays);
  throw Error(why + "; nothing was submitted");
}

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, '|');) fields.push_back(field);
  return fields;
}

// Takes "17_3|1000|RUNNING|node2|None": the job's number and the task's, its argument, and the
// rest.
std::optional<QueuedTask> task_of(const std::vector<std::string>& fields) {
  if (fields.size() < 3) return std::nullopt;
  const auto field = [&](std::size_t index) {
    return index < fields.size() ? fields[index] : std::string();
  };
  QueuedTask task{std::nullopt, fields[2], field(3), field(4)};
  const std::size_t under = fields[0].find('_');
  if (under == std::string::npos) return task;
  const auto index = number_in(fields[0].substr(under + 1));
  const auto offset = number_in(fields[1]);
  if (index) task.number = *index + offset.value_or(0);
  return task;
}

}  // namespace

void cancel_tasks(const JobFolder& folder) {
  const ProgramResult result = run_program("scancel", {"--name=" + folder.name()});
  if (!result.is_good()) throw Error("scancel does not cancel the job: " + result.why());
}

bool has_slurm() {
  return run_program("sbatch", {"--version"}).is_good();
}

void write_scripts(const JobFolder& folder, const ScriptPlaces& places) {
  session::replace_file(folder.task_script(), slurm_tasks(places));
  session::replace_file(folder.finish_script(), slurm_finish(places));
  session::replace_file(folder.loop_script(), shell_loop(places));
}

void submit_tasks(const JobFolder& folder, const Job& job, std::uint64_t tasks,
                  const std::vector<std::string>& more, std::ostream& out) {
  std::string submitted;
  try {
    for_each_job(folder, job, tasks, more,
                 [&](const std::string& about, const std::vector<std::string>& arguments) {
                   std::string number = std::to_string(submit_one(arguments));
                   submitted += about + ": job " + number + "\n";
                   session::replace_file(folder.submitted_file(), submitted);
                   return number;
                 });
  } catch (const std::exception& error) {
    take_back(folder, error.what());
  }
  out << submitted << std::flush;
}

void print_submission(const JobFolder& folder, const Job& job, const ScriptPlaces& places,
                      const std::vector<std::string>& more, std::ostream& out) {
  out << "# " << folder.task_script().string() << "\n" << slurm_tasks(places) << "\n";
  out << "# " << folder.finish_script().string() << "\n" << slurm_finish(places) << "\n";
  for_each_job(folder, job, job.tasks(job.frames()), more,
               [&](const std::string&, const std::vector<std::string>& arguments) {
                 out << quoted_command(arguments) << "\n";
                 return std::string("RENDER");
               });
  out << std::flush;
}

bool was_submitted(const JobFolder& folder) {
  std::error_code unknown;
  return std::filesystem::exists(folder.submitted_file(), unknown);
}

// squeue is asked for the job's name, which no file of the folder can choose, and by which a part
// is found whose number was never written down.
std::vector<QueuedTask> queued_tasks(const JobFolder& folder) {
  const ProgramResult result = run_program(
      "squeue", {"--noheader", "--array", "--name=" + folder.name(), "--format=%i|%k|%T|%N|%r"});
  if (!result.is_good()) throw Error("squeue does not respond: " + result.why());
  std::vector<QueuedTask> tasks;
  std::istringstream lines(result.out);
  for (std::string line; std::getline(lines, line);)
    if (std::optional<QueuedTask> task = task_of(fields_of(line)))
      tasks.push_back(*std::move(task));
  return tasks;
}

}  // namespace previz::farm
