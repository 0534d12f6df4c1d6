#include "daemon/farm/status.hpp"

#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <ostream>

#include "daemon/farm/slurm.hpp"
#include "daemon/output/progress.hpp"
#include "daemon/post/folder_locks.hpp"
#include "daemon/post/render_files.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Returns whether a process is at work in the chunk's folder, on whatever machine.
bool is_taken(const std::filesystem::path& folder) {
  std::error_code unknown;
  if (!std::filesystem::exists(folder / post::FolderLocks::file_name, unknown)) return false;
  try {
    post::FolderLocks locks(folder);
    const post::FolderLocks::Transaction transaction(locks);
    return !locks.others().empty();
  } catch (const Error&) {
    return false;
  }
}

std::uint64_t length_of(const post::FrameRange& range) {
  return range.last - range.first + 1;
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
    if (!task.chunk || *task.chunk >= status.chunks.size()) continue;
    ChunkStatus& chunk = status.chunks[*task.chunk];
    chunk.queue = task.state;
    if (task.state == "RUNNING") chunk.is_running = true;
  }
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
    chunk.is_running = says_it_runs && is_taken(folder.chunk(i));
  }
  status.seconds_a_frame = status.done > 0 ? status.seconds_a_frame / double(status.done) : 0;
  if (has_slurm()) add_queue(folder, status);
  status.running = static_cast<std::size_t>(
      std::ranges::count_if(status.chunks, [](const ChunkStatus& one) { return one.is_running; }));
  status.stopped = folder.read_stopped();
  return status;
}

std::optional<double> JobStatus::seconds_left() const {
  if (running == 0 || done == 0) return std::nullopt;
  return static_cast<double>(frames - done) * seconds_a_frame / static_cast<double>(running);
}

bool ChunkStatus::has_failed() const {
  if (done == frames || is_running || !state) return false;
  const bool waits = queue == "PENDING" || queue == "REQUEUED";
  return !waits || !state->message.empty();
}

}  // namespace previz::farm
