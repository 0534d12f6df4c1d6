#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <ostream>

#include "daemon/core/output/progress.hpp"
#include "daemon/core/report/printable.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/tools/farm/status.hpp"

namespace previz::farm {
namespace {

std::string bar(double share) {
  constexpr int width = 32;
  const int full = std::clamp(static_cast<int>(share * width), 0, width);
  return "[" + std::string(static_cast<std::size_t>(full), '#') +
         std::string(static_cast<std::size_t>(width - full), '-') + "]";
}

// Returns where a task runs. Slurm knows it at once; the task's own word may be that of its last
// machine.
std::string machine_of(const TaskStatus& task) {
  if (!task.node.empty()) return task.node;
  return task.state ? task.state->host : "a machine that says nothing";
}

std::string refusal_of(const TaskState& state) {
  return state.host + ": " + state.message;
}

// Returns how it stands with a task that runs, waits again or has failed; empty: there is nothing
// to say about it.
std::string words_of(const TaskStatus& task) {
  switch (task.phase()) {
    case TaskPhase::running:
      return "running on " + machine_of(task) + (task.frames.empty() ? "" : ", " + task.frames);
    case TaskPhase::again:
      return (task.queue == "RUNNING" ? "waiting to be requeued: " : "waiting again: ") +
             refusal_of(*task.state);
    case TaskPhase::failed:
      if (!task.state) return "";
      return task.state->message.empty() ? "ended on " + task.state->host + " before its time"
                                         : refusal_of(*task.state);
    default:
      return "";
  }
}

// Returns why a part waits: squeue's reason, or its state where that is a rarer one.
std::string why_waiting(const std::string& queue, const std::string& reason) {
  if (queue != "PENDING" && queue != "RUNNING") return queue;
  return reason.empty() || reason == "None" ? "Slurm gives no reason yet" : reason;
}

void print_queue(const JobStatus& status, std::ostream& out) {
  std::map<std::string, std::size_t> reasons;
  for (const auto& [name, task] : status.tasks)
    if (!task.queue.empty() && task.queue != "RUNNING" && task.phase() != TaskPhase::done)
      ++reasons[why_waiting(task.queue, task.reason)];
  for (const auto& [reason, count] : reasons)
    out << "waiting in the queue: " << on_one_line(reason) << " (" << count
        << (count == 1 ? " task)" : " tasks)") << "\n";
  // The last step waits for all others in any case.
  const bool is_last = status.done == status.frames || status.finish_reason != "Dependency";
  if (!status.finish_queue.empty() && status.finish_queue != "RUNNING" && is_last)
    out << "waiting in the queue: "
        << on_one_line(why_waiting(status.finish_queue, status.finish_reason))
        << " (the last step)\n";
}

// Prints what is to be done once all frames are rendered.
void print_last_step(const JobFolder& folder, const Job& job, const JobStatus& status,
                     std::ostream& out) {
  const std::string command = "`previz farm finish " + folder.path().string() + "`";
  if (status.is_complete()) {
    for (const JobTake& take : job.takes)
      out << "pictures: " << on_one_line(take.pictures.string()) << "\n";
    return;
  }
  if (status.finish_queue == "RUNNING") out << "the last step runs\n";
  if (!status.finish_queue.empty()) return;
  std::string words = "the last step has not run; " + command + " does it";
  if (status.finish && status.finish->outcome == TaskOutcome::running)
    words = "the last step began on " + status.finish->host + " at " + status.finish->since +
            "; where it does not run any more, " + command + " does it again";
  else if (status.finish)
    words = "the last step has failed on " + status.finish->host +
            (status.finish->message.empty() ? "" : ": " + status.finish->message) + "; " + command +
            " does it again";
  out << on_one_line(words) << "\n";
}

}  // namespace

void print_words(const JobFolder& folder, const Job& job, const JobStatus& status, bool terminal,
                 std::ostream& out) {
  const bool has_ranges = status.parts > status.frames;
  const std::size_t running = status.count(TaskPhase::running);
  const bool is_done = status.done == status.frames;
  if (terminal)
    out << bar(static_cast<double>(status.parts_done) / static_cast<double>(status.parts)) << " ";
  out << status.done << " of " << set::plural(status.frames, "frame") << " done, ";
  if (has_ranges)
    out << status.parts_done << " of their " << set::plural(status.parts, "sample range") << ", ";
  out << set::plural(running, "task") << " running, ";
  if (const std::size_t again = status.count(TaskPhase::again); again > 0)
    out << again << " waiting again, ";
  out << (is_done ? 0 : status.count(TaskPhase::failed)) << " failed";
  if (const std::optional<double> left = status.seconds_left(); left && !is_done)
    out << ", about " << output::duration_words(*left) << " left";
  out << "\n";
  if (!status.stopped.empty()) out << "stopped: " << on_one_line(status.stopped) << "\n";
  print_queue(status, out);
  for (const auto& [name, task] : status.tasks)
    if (const std::string words = words_of(task); !is_done && !words.empty())
      out << "task " << name << ": " << on_one_line(words) << "\n";
  const bool is_idle = !status.is_queued && running == 0;
  if (!is_done && is_idle)
    out << "nothing runs under this job's name, " << folder.name()
        << ": `previz farm retry` renders what is missing\n";
  if (is_done) print_last_step(folder, job, status, out);
  out << std::flush;
}

void print_json(const JobStatus& status, std::ostream& out) {
  nlohmann::ordered_json json{{"frames", status.frames},
                              {"done", status.done},
                              {"running", status.count(TaskPhase::running)},
                              {"is_queued", status.is_queued},
                              {"stopped", status.stopped},
                              {"is_complete", status.is_complete()}};
  if (const std::optional<double> left = status.seconds_left()) json["seconds_left"] = *left;
  json["tasks"] = nlohmann::ordered_json::array();
  for (const auto& [name, task] : status.tasks) {
    nlohmann::ordered_json one{{"task", name},
                               {"frames", task.frames},
                               {"running", task.phase() == TaskPhase::running},
                               {"failed", task.phase() == TaskPhase::failed}};
    if (!task.queue.empty()) one["queue"] = task.queue;
    if (!task.node.empty()) one["node"] = task.node;
    if (!task.reason.empty()) one["reason"] = task.reason;
    if (task.state) {
      one["outcome"] = name_of(task.state->outcome);
      one["host"] = task.state->host;
      one["message"] = task.state->message;
    }
    json["tasks"].push_back(std::move(one));
  }
  out << json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
}

}  // namespace previz::farm
