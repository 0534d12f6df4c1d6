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

// The tasks of an array, whose numbers count from `offset`.
struct Array {
  std::size_t offset = 0;
  std::set<std::size_t> indices;
};

// Divides chunks into arrays of numbers that Slurm allows.
std::vector<Array> arrays_of(const std::set<std::size_t>& chunks, std::size_t first,
                             std::size_t end, std::size_t size) {
  std::vector<Array> arrays;
  for (auto at = chunks.lower_bound(first); at != chunks.end() && *at < end; ++at) {
    const std::size_t offset = *at / size * size;
    if (arrays.empty() || arrays.back().offset != offset) arrays.push_back({offset, {}});
    arrays.back().indices.insert(*at - offset);
  }
  return arrays;
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

// Hands over the arrays of these chunks, and then the last step.
void for_each_job(const JobFolder& folder, const Job& job, const std::set<std::size_t>& chunks,
                  const std::vector<std::string>& more, const Submit& submit) {
  const std::size_t size = array_size();
  std::vector<std::string> all;
  const auto add_arrays = [&](const char* about, std::size_t first, std::size_t end) {
    const std::vector<std::string> needed = all;
    std::string before;
    for (const Array& array : arrays_of(chunks, first, end, size)) {
      std::vector<std::string> after = needed;
      // Slurm limits each array by itself.
      if (job.wishes.at_once > 0 && !before.empty()) after.push_back(before);
      before = submit(about, sbatch_arguments(folder, job, index_list(array.indices), array.offset,
                                              after, more));
      all.push_back(before);
    }
  };
  add_arrays("render", 0, job.first_merge());
  add_arrays("merge", job.first_merge(), job.chunks.size());
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
  const std::string name = "--name=" + folder.name();
  std::string fault;
  try {
    const ProgramResult result = run_program("scancel", {name});
    if (!result.is_good()) fault = result.why();
  } catch (const Error& error) {
    fault = error.what();
  }
  if (!fault.empty())
    throw Error(why + "; a part may be in the queue already, and scancel cannot remove it (" +
                fault + "); run `scancel " + name + "`");
  try {
    folder.write_submitted({});
  } catch (const Error&) {
    // The numbers of jobs that were cancelled do no harm.
  }
  throw Error(why + "; nothing was submitted");
}

// Returns the numbers of what was submitted, "17,18"; empty: nothing was.
std::string submitted_numbers(const JobFolder& folder) {
  const Submitted submitted = folder.read_submitted();
  std::string numbers;
  for (const std::uint64_t number : submitted.tasks)
    add_to_list(numbers, std::to_string(number), ",");
  if (submitted.finish) add_to_list(numbers, std::to_string(*submitted.finish), ",");
  return numbers;
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
  if (index) task.chunk = static_cast<std::size_t>(*index + offset.value_or(0));
  return task;
}

}  // namespace

bool has_slurm() {
  return run_program("sbatch", {"--version"}).is_good();
}

std::string index_list(const std::set<std::size_t>& indices) {
  std::string list;
  for (auto at = indices.begin(); at != indices.end();) {
    const std::size_t first = *at;
    std::size_t last = first;
    while (++at != indices.end() && *at == last + 1) last = *at;
    add_to_list(list, std::to_string(first) + (last > first ? "-" + std::to_string(last) : ""),
                ",");
  }
  return list;
}

void write_scripts(const JobFolder& folder, const Job& job, const ScriptPlaces& places) {
  session::replace_file(folder.task_script(), slurm_tasks(places));
  session::replace_file(folder.finish_script(), slurm_finish(places));
  session::replace_file(folder.loop_script(), shell_loop(places, job));
}

void submit_chunks(const JobFolder& folder, const Job& job, const std::set<std::size_t>& chunks,
                   const std::vector<std::string>& more, std::ostream& out) {
  Submitted submitted;
  std::string printed;
  folder.write_submitted(submitted);
  try {
    for_each_job(folder, job, chunks, more,
                 [&](const std::string& about, const std::vector<std::string>& arguments) {
                   const std::uint64_t number = submit_one(arguments);
                   if (about == "check")
                     submitted.finish = number;
                   else
                     submitted.tasks.push_back(number);
                   folder.write_submitted(submitted);
                   printed += about + ": job " + std::to_string(number) + "\n";
                   return std::to_string(number);
                 });
  } catch (const std::exception& error) {
    take_back(folder, error.what());
  }
  out << printed << std::flush;
}

void print_submission(const JobFolder& folder, const Job& job, const ScriptPlaces& places,
                      const std::vector<std::string>& more, std::ostream& out) {
  std::set<std::size_t> chunks;
  for (std::size_t chunk = 0; chunk < job.chunks.size(); ++chunk) chunks.insert(chunk);
  out << "# " << folder.task_script().string() << "\n" << slurm_tasks(places) << "\n";
  out << "# " << folder.finish_script().string() << "\n" << slurm_finish(places) << "\n";
  for_each_job(folder, job, chunks, more,
               [&](const std::string& about, const std::vector<std::string>& arguments) {
                 out << quoted_command(arguments) << "\n";
                 return std::string(about == "merge" ? "MERGE" : "RENDER");
               });
  out << std::flush;
}

bool was_submitted(const JobFolder& folder) {
  std::error_code unknown;
  return std::filesystem::exists(folder.path() / "submitted.json", unknown);
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

std::string numbers_of_others(const JobFolder& folder) {
  const std::string numbers = submitted_numbers(folder);
  if (numbers.empty()) return "";
  const ProgramResult result =
      run_program("squeue", {"--noheader", "--jobs=" + numbers, "--format=%A|%j"});
  // It does not know jobs that ended long ago.
  if (!result.is_good() && result.errors.find("Invalid job id") != std::string::npos) return "";
  if (!result.is_good()) throw Error("squeue does not respond: " + result.why());
  std::set<std::string> others;
  std::istringstream lines(result.out);
  for (std::string line; std::getline(lines, line);) {
    const std::vector<std::string> fields = fields_of(line);
    if (fields.size() > 1 && fields[1] != folder.name()) others.insert(fields[0]);
  }
  std::string list;
  for (const std::string& number : others) add_to_list(list, number, ",");
  return list;
}

bool cancel_tasks(const JobFolder& folder) {
  if (queued_tasks(folder).empty()) return false;
  const ProgramResult result = run_program("scancel", {"--name=" + folder.name()});
  if (!result.is_good()) throw Error("scancel does not cancel the job: " + result.why());
  return true;
}

}  // namespace previz::farm
