#include "daemon/tools/farm/status.hpp"

#include <algorithm>
#include <map>

#include "daemon/tools/farm/slurm.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Where that is not known, no task is said to run.
bool is_taken(const JobFolder& folder, std::size_t chunk) {
  try {
    return folder.taken(chunk) != Taken::no;
  } catch (const Error&) {
    return false;
  }
}

// Adds up what one chunk has finished.
void count(const JobFolder& folder, const Job& job, std::size_t index, JobStatus& status,
           const std::map<std::uint64_t, post::FinishedFrame>& pictures) {
  const Chunk& chunk = job.chunks[index];
  const JobTake& take = job.takes[chunk.take];
  ChunkStatus& one = status.chunks[index];
  const bool is_sums = chunk.kind == ChunkKind::sums;
  const auto part =
      post::finished_frames({folder.chunk(index), take.exr, take.png, false}, is_sums);
  for (std::uint64_t frame = chunk.frames.first; frame <= chunk.frames.last; ++frame) {
    const auto there = pictures.find(frame);
    const auto here = part.find(frame);
    const post::FinishedFrame* const finished = there != pictures.end() ? &there->second
                                                : here != part.end()    ? &here->second
                                                                        : nullptr;
    if (!finished) continue;
    ++one.done;
    if (is_sums) continue;
    ++status.done;
    status.seconds_a_frame += finished->render_s;  // the mean, once all are added
  }
}

void add_queue(const JobFolder& folder, JobStatus& status) {
  for (const QueuedTask& task : queued_tasks(folder)) {
    status.is_queued = true;
    if (!task.chunk) {
      status.finish_queue = task.state;
      status.finish_reason = task.reason;
    }
    if (!task.chunk || *task.chunk >= status.chunks.size()) continue;
    ChunkStatus& chunk = status.chunks[*task.chunk];
    chunk.queue = task.state;
    chunk.node = task.node;
    chunk.reason = task.reason;
    // A task that a machine has refused holds the machine for a while, and Slurm says that it runs.
    const bool was_refused = chunk.state && (chunk.state->outcome == TaskOutcome::machine ||
                                             chunk.state->outcome == TaskOutcome::job);
    if (task.state == "RUNNING") chunk.is_running = !was_refused;
    if (task.state == "SUSPENDED") chunk.is_running = false;
  }
  if (!status.is_queued) status.others = numbers_of_others(folder);
}

bool has_parts(const JobFolder& folder) {
  std::error_code unknown;
  return std::filesystem::directory_iterator(folder.place("chunks"), unknown) !=
         std::filesystem::directory_iterator();
}

}  // namespace

JobStatus status_of(const JobFolder& folder, const Job& job) {
  JobStatus status;
  status.chunks.resize(job.chunks.size());
  std::vector<std::map<std::uint64_t, post::FinishedFrame>> pictures;
  for (const JobTake& take : job.takes) {
    pictures.push_back(post::finished_frames({take.pictures, take.exr, take.png, false}));
    status.frames += length_of(take.frames);
  }
  for (std::size_t i = 0; i < job.chunks.size(); ++i) {
    count(folder, job, i, status, pictures[job.chunks[i].take]);
    ChunkStatus& chunk = status.chunks[i];
    chunk.state = folder.read_state(i);
    chunk.frames = length_of(job.chunks[i].frames);
    const bool says_it_runs = chunk.state && chunk.state->outcome == TaskOutcome::running;
    chunk.is_running = says_it_runs && is_taken(folder, i);
  }
  status.seconds_a_frame = status.done > 0 ? status.seconds_a_frame / double(status.done) : 0;
  if (was_submitted(folder) && has_slurm()) add_queue(folder, status);
  status.running = static_cast<std::size_t>(
      std::ranges::count_if(status.chunks, [](const ChunkStatus& one) { return one.is_running; }));
  status.stopped = folder.read_stopped();
  status.finish = folder.read_finish_state();
  status.has_parts = has_parts(folder);
  return status;
}

std::optional<double> JobStatus::seconds_left() const {
  if (running == 0 || done == 0) return std::nullopt;
  return static_cast<double>(frames - done) * seconds_a_frame / static_cast<double>(running);
}

std::size_t JobStatus::count(TaskPhase phase) const {
  return static_cast<std::size_t>(std::ranges::count(chunks, phase, &ChunkStatus::phase));
}

// Where its own word was lost, the last step is known to have ended by the folders of chunks, which
// it removes.
bool JobStatus::is_complete() const {
  if (done < frames || !finish_queue.empty()) return false;
  return finish ? finish->outcome == TaskOutcome::done : !has_parts;
}

TaskPhase ChunkStatus::phase() const {
  if (done == frames) return TaskPhase::done;
  if (is_running) return TaskPhase::running;
  const bool is_ending = queue == "RUNNING" && state && state->outcome == TaskOutcome::job;
  if (!queue.empty() && !is_ending)
    return state && !state->message.empty() ? TaskPhase::again : TaskPhase::waiting;
  return state ? TaskPhase::failed : TaskPhase::idle;
}

}  // namespace previz::farm
