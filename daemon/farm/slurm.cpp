#include "daemon/farm/slurm.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <ostream>
#include <sstream>

#include "daemon/farm/program.hpp"
#include "drivers/error.hpp"
#include "drivers/session/draft.hpp"

namespace previz::farm {
namespace {

// What slurm.conf has where it says nothing: the highest number of a task is one less.
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

// Hands jobs over one after the other, or takes them all back.
class Submission {
 public:
  Submission(const JobFolder& folder, const Job& job, const std::vector<std::string>& more)
      : folder_(folder), job_(job), more_(more) {}

  // Returns the numbers of the arrays.
  std::vector<std::string> add_arrays(const std::vector<Array>& arrays,
                                      const std::vector<std::string>& after) {
    std::vector<std::string> numbers;
    for (const Array& array : arrays) {
      const std::uint64_t number = sbatch(
          sbatch_arguments(folder_, job_, index_list(array.indices), array.offset, after, more_));
      numbers.push_back(std::to_string(number));
      submitted_.tasks.push_back(number);
    }
    return numbers;
  }
  void add_finish(const std::vector<std::string>& after) {
    submitted_.finish = sbatch(sbatch_finish_arguments(folder_, job_, after, more_));
  }
  const Submitted& submitted() const { return submitted_; }

 private:
  std::uint64_t sbatch(const std::vector<std::string>& arguments) {
    const ProgramResult result = run_program("sbatch", arguments);
    const std::optional<std::uint64_t> number =
        result.is_good() ? number_in(result.out) : std::nullopt;
    if (number) return *number;
    for (const std::uint64_t before : submitted_.tasks)
      run_program("scancel", {std::to_string(before)});
    throw Error("sbatch does not take the job: " +
                (result.is_good() ? "it prints no number, but: " + result.out : result.why()) +
                "; nothing was submitted");
  }

  const JobFolder& folder_;
  const Job& job_;
  const std::vector<std::string>& more_;
  Submitted submitted_;
};

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
  if (fields.size() < 5) return std::nullopt;
  QueuedTask task{std::nullopt, fields[2], fields[3], fields[4]};
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
  const std::size_t size = array_size();
  Submission submission(folder, job, more);
  const std::vector<std::string> rendered =
      submission.add_arrays(arrays_of(chunks, 0, job.first_merge(), size), {});
  const std::vector<std::string> merged = submission.add_arrays(
      arrays_of(chunks, job.first_merge(), job.chunks.size(), size), rendered);
  std::vector<std::string> all = rendered;
  all.insert(all.end(), merged.begin(), merged.end());
  submission.add_finish(all);
  folder.write_submitted(submission.submitted());
  for (const std::string& number : rendered) out << "render: job " << number << "\n";
  for (const std::string& number : merged) out << "merge: job " << number << "\n";
  out << "check: job " << *submission.submitted().finish << std::endl;
}

void print_submission(const JobFolder& folder, const Job& job, const ScriptPlaces& places,
                      const std::vector<std::string>& more, std::ostream& out) {
  std::set<std::size_t> chunks;
  for (std::size_t chunk = 0; chunk < job.chunks.size(); ++chunk) chunks.insert(chunk);
  out << "# " << folder.task_script().string() << "\n" << slurm_tasks(places) << "\n";
  out << "# " << folder.finish_script().string() << "\n" << slurm_finish(places) << "\n";
  const std::size_t size = array_size();
  std::vector<std::string> after;
  const auto print = [&](std::size_t first, std::size_t end, const char* name) {
    std::vector<std::string> numbers;
    for (const Array& array : arrays_of(chunks, first, end, size)) {
      out << quoted_command(sbatch_arguments(folder, job, index_list(array.indices), array.offset,
                                             after, more))
          << "\n";
      numbers.emplace_back(name);
    }
    after.insert(after.end(), numbers.begin(), numbers.end());
  };
  print(0, job.first_merge(), "RENDER");
  print(job.first_merge(), job.chunks.size(), "MERGE");
  out << quoted_command(sbatch_finish_arguments(folder, job, after, more)) << std::endl;
}

// The name is compared as well, because the numbers come from a file.
std::vector<QueuedTask> queued_tasks(const JobFolder& folder) {
  const std::string numbers = submitted_numbers(folder);
  if (numbers.empty()) return {};
  const ProgramResult result =
      run_program("squeue", {"--noheader", "--array", "--jobs=" + numbers,
                             "--name=" + folder.name(), "--format=%i|%k|%T|%N|%r"});
  // It does not know jobs that ended long ago.
  if (!result.is_good() && result.errors.find("Invalid job id") != std::string::npos) return {};
  if (!result.is_good()) throw Error("squeue does not respond: " + result.why());
  std::vector<QueuedTask> tasks;
  std::istringstream lines(result.out);
  for (std::string line; std::getline(lines, line);)
    if (std::optional<QueuedTask> task = task_of(fields_of(line)))
      tasks.push_back(*std::move(task));
  return tasks;
}

void cancel_tasks(const JobFolder& folder) {
  const Submitted submitted = folder.read_submitted();
  std::vector<std::string> arguments{"--name=" + folder.name()};
  for (const std::uint64_t number : submitted.tasks) arguments.push_back(std::to_string(number));
  if (submitted.finish) arguments.push_back(std::to_string(*submitted.finish));
  if (arguments.size() == 1) throw Error(folder.path().string() + ": was not submitted to Slurm");
  const ProgramResult result = run_program("scancel", arguments);
  if (!result.is_good()) throw Error("scancel does not respond: " + result.why());
}

}  // namespace previz::farm
