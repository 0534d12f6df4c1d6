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

std::string frames_done(const ChunkStatus& status) {
  return std::to_string(status.done) + " of " + set::plural(status.frames, "frame") + " done";
}

// Returns where a task runs. Slurm knows it at once; the task's own word may be that of its last
// machine.
std::string machine_of(const ChunkStatus& status) {
  if (!status.node.empty()) return status.node;
  return status.state ? status.state->host : "a machine that says nothing";
}

std::string refusal_of(const TaskState& state) {
  return state.host + ": " + state.message;
}

// Returns how it stands with a task that runs, waits again or has failed; empty: there is nothing
// to say about it.
std::string words_of(const ChunkStatus& status) {
  switch (status.phase()) {
    case TaskPhase::running:
      return "running on " + machine_of(status) + ", " + frames_done(status);
    case TaskPhase::again:
      return (status.queue == "RUNNING" ? "waiting to be requeued: " : "waiting again: ") +
             refusal_of(*status.state);
    case TaskPhase::failed:
      return status.state->message.empty()
                 ? "ended on " + status.state->host + " with " + frames_done(status)
                 : refusal_of(*status.state);
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
  for (const ChunkStatus& chunk : status.chunks)
    if (!chunk.queue.empty() && chunk.queue != "RUNNING" && chunk.phase() != TaskPhase::done)
      ++reasons[why_waiting(chunk.queue, chunk.reason)];
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
  const double share =
      status.frames > 0 ? static_cast<double>(status.done) / static_cast<double>(status.frames) : 1;
  if (terminal) out << bar(share) << " ";
  out << status.done << " of " << set::plural(status.frames, "frame") << " done, "
      << set::plural(status.running, "task") << " running, ";
  if (const std::size_t again = status.count(TaskPhase::again); again > 0)
    out << again << " waiting again, ";
  out << status.count(TaskPhase::failed) << " failed";
  if (const std::optional<double> left = status.seconds_left(); left && status.done < status.frames)
    out << ", about " << output::duration_words(*left) << " left";
  out << "\n";
  if (!status.stopped.empty()) out << "stopped: " << on_one_line(status.stopped) << "\n";
  print_queue(status, out);
  for (std::size_t i = 0; i < status.chunks.size(); ++i)
    if (const std::string words = words_of(status.chunks[i]); !words.empty())
      out << "task " << i << ", " << on_one_line(words_of(job, job.chunks[i]) + ": " + words)
          << "\n";
  const bool is_idle = !status.is_queued && status.running == 0;
  if (!status.others.empty())
    out << "in the queue under another name: " << status.others
        << "; they are this job's if its folder was moved or is given by another path, and "
           "otherwise another job's: `squeue --jobs="
        << status.others << "` shows them\n";
  else if (status.done < status.frames && is_idle)
    out << "nothing runs: `previz farm retry` renders what is missing\n";
  if (status.done == status.frames) print_last_step(folder, job, status, out);
  out << std::flush;
}

void print_json(const Job& job, const JobStatus& status, std::ostream& out) {
  nlohmann::ordered_json json{{"frames", status.frames},   {"done", status.done},
                              {"running", status.running}, {"is_queued", status.is_queued},
                              {"stopped", status.stopped}, {"is_complete", status.is_complete()}};
  if (const std::optional<double> left = status.seconds_left()) json["seconds_left"] = *left;
  json["tasks"] = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < status.chunks.size(); ++i) {
    const ChunkStatus& chunk = status.chunks[i];
    nlohmann::ordered_json one{{"task", i},
                               {"about", words_of(job, job.chunks[i])},
                               {"frames", chunk.frames},
                               {"done", chunk.done},
                               {"running", chunk.is_running},
                               {"failed", chunk.phase() == TaskPhase::failed}};
    if (!chunk.queue.empty()) one["queue"] = chunk.queue;
    if (!chunk.node.empty()) one["node"] = chunk.node;
    if (!chunk.reason.empty()) one["reason"] = chunk.reason;
    if (chunk.state) {
      one["outcome"] = name_of(chunk.state->outcome);
      one["host"] = chunk.state->host;
      one["message"] = chunk.state->message;
    }
    json["tasks"].push_back(std::move(one));
  }
  out << json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) << std::endl;
}

}  // namespace previz::farm
