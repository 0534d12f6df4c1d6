#include "daemon/tools/farm/finish.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <thread>
#include <utility>

#include "daemon/core/report/printable.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/timecode.hpp"
#include "daemon/tools/farm/settings.hpp"
#include "daemon/tools/farm/task.hpp"
#include "daemon/tools/post/folder_locks.hpp"
#include "daemon/tools/post/render_directory.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "daemon/tools/post/render_plan.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

set::Output output_of(const JobTake& take, const std::filesystem::path& folder, bool video) {
  return {folder, take.exr, take.png, video};
}

// Finds out about one take.
class TakeProof {
 public:
  TakeProof(const JobFolder& folder, const Job& job, std::size_t take, Foreign foreign,
            std::ostream& out, const std::stop_token& stop)
      : foreign_(foreign),
        folder_(folder),
        job_(job),
        take_(job.takes.at(take)),
        index_(take),
        out_(out),
        stop_(stop),
        pictures_(output_of(take_, take_.pictures, false), take_.settings, false, {}, take_.frames,
                  stop) {}

  void run(Proof& proof);

 private:
  void wait_for_a_look(std::size_t chunk) const;
  void collect(std::size_t chunk);
  std::string why_not_ours(std::size_t chunk) const;
  std::string why_missing(std::size_t chunk) const;
  bool is_wanted_device(const post::FinishedFrame& frame) const {
    return job_.any_device || frame.made_on.is_gpu == job_.on_gpu;
  }

  const Foreign foreign_;
  const JobFolder& folder_;
  const Job& job_;
  const JobTake& take_;
  const std::size_t index_;
  std::ostream& out_;
  const std::stop_token& stop_;
  post::RenderDirectory pictures_;
  std::map<std::size_t, std::string> faults_;  // by chunk: why its frames stay where they are
  std::map<std::uint64_t, std::string> frame_faults_;  // by frame: the same
};

// Returns why the frames of a chunk's folder are not taken over; empty: they may be.
std::string TakeProof::why_not_ours(std::size_t chunk) const {
  const std::filesystem::path file = folder_.chunk(chunk) / "render.json";
  const std::string settings = post::read_settings(folder_.chunk(chunk));
  if (!same_settings(settings, take_.settings))
    return file.string() +
           ": these frames were rendered with other settings or another version of "
           "previzd: " +
           difference_words(settings, take_.settings);
  return "";
}

// Waits while a task is at a chunk whose frames are all there, which it only looks at: in the loop
// machines come to the end one after the other.
void TakeProof::wait_for_a_look(std::size_t chunk) const {
  const Chunk& plan = job_.chunks[chunk];
  for (bool is_told = false; folder_.taken(chunk) != Taken::no; is_told = true) {
    const auto there = post::finished_frames({folder_.chunk(chunk), take_.exr, take_.png, false},
                                             /*has_sums=*/false, plan.frames);
    for (std::uint64_t frame = plan.frames.first; frame <= plan.frames.last; ++frame)
      if (!there.contains(frame) && !pictures_.finished(frame)) return;
    if (!is_told)
      out_ << "waits for a process that looks at the files of chunk " << chunk << std::endl;
    if (stop_.stop_requested()) throw Error(folder_.chunk(chunk).string() + ": interrupted");
    // A look ends by its lock or by a file, for which nothing can wait that a stop ends.
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

void TakeProof::collect(std::size_t chunk) {
  const std::filesystem::path folder = folder_.chunk(chunk);
  std::error_code unknown;
  if (!std::filesystem::exists(folder / "render.json", unknown)) return;
  if (std::string why = why_not_ours(chunk); !why.empty()) {
    faults_[chunk] = std::move(why);
    return;
  }
  wait_for_a_look(chunk);
  if (const Taken taken = folder_.taken(chunk); taken != Taken::no) {
    faults_[chunk] = taken == Taken::shared
                         ? "is being rendered"
                         : "is being rendered, or was until less than three minutes ago by a "
                           "machine that has died";
    return;
  }
  const Chunk& plan = job_.chunks[chunk];
  post::take_back(folder, take_.pictures);
  post::RenderDirectory part(output_of(take_, folder, false), post::read_settings(folder), false,
                             {}, plan.frames, stop_);
  for (const auto& [why, frames] : part.rejected())
    for (const std::uint64_t frame : frames) frame_faults_[frame] = why;
  const std::vector<post::FinishedFrame> foreign =
      part.reject([&](const post::FinishedFrame& frame) { return !is_wanted_device(frame); });
  for (const post::FinishedFrame& frame : foreign)
    frame_faults_[frame.frame] = "was rendered on " + frame.made_on.device +
                                 ", and the job is rendered on " +
                                 (job_.on_gpu ? "graphics cards" : "processors") +
                                 "; `previz farm finish --any-device` takes both, and `previz "
                                 "farm retry` renders it again";
  if (foreign_ == Foreign::forget) part.forget(foreign);
  pictures_.adopt(part);
}

std::string TakeProof::why_missing(std::size_t chunk) const {
  if (const auto fault = faults_.find(chunk); fault != faults_.end()) return fault->second;
  const std::optional<TaskState> state = folder_.read_state(chunk);
  if (!state) return "not begun";
  if (!state->message.empty()) return "on " + state->host + ": " + state->message;
  switch (state->outcome) {
    case TaskOutcome::done:
      return "not there any more, after they were rendered on " + state->host;
    case TaskOutcome::stopped:
      return "stopped on " + state->host;
    default:
      return "ended on " + state->host + " without a word: killed, or the machine failed";
  }
}

void TakeProof::run(Proof& proof) {
  for (const auto& [why, frames] : pictures_.rejected())
    out_ << on_one_line(take_.pictures.string() + ": " + post::frames_words(frames) + ": " + why)
         << std::endl;
  std::map<std::string, MissingFrames> missing;
  std::set<std::string> cards;
  for (std::size_t chunk = 0; chunk < job_.chunks.size(); ++chunk) {
    const Chunk& plan = job_.chunks[chunk];
    if (plan.take != index_ || plan.kind == ChunkKind::sums) continue;
    collect(chunk);
    std::optional<std::string> why;  // of its frames that have no fault of their own
    for (std::uint64_t frame = plan.frames.first; frame <= plan.frames.last; ++frame) {
      if (const post::FinishedFrame* finished = pictures_.finished(frame)) {
        cards.insert(finished->made_on.device);
        continue;
      }
      const auto fault = frame_faults_.find(frame);
      if (fault == frame_faults_.end() && !why) why = why_missing(chunk);
      MissingFrames& these = missing[fault == frame_faults_.end() ? *why : fault->second];
      these.take = index_;
      these.frames.push_back(frame);
      proof.chunks.insert(chunk);
    }
  }
  for (auto& [why, frames] : missing) {
    frames.why = why;
    proof.missing.push_back(std::move(frames));
  }
  if (cards.size() < 2) return;
  std::string names;
  for (const std::string& card : cards) add_to_list(names, card.empty() ? "unknown" : card);
  proof.notes.push_back(take_.pictures.string() + ": rendered on " + names +
                        ", whose pictures differ in the last bits");
}

// Removes what `previz render` leaves in a folder, and the folder if nothing else is in it.
void remove_chunk(const std::filesystem::path& folder) {
  session::remove_dead_drafts(folder);
  std::error_code code;
  for (std::filesystem::directory_iterator entry(folder, code), end; !code && entry != end;
       entry.increment(code)) {
    const std::string name = entry->path().filename().string();
    const bool is_ours = name == post::settings_name || name == post::lines_name ||
                         name == post::FolderLocks::file_name || post::frame_of(name);
    std::error_code stays;
    if (is_ours && !entry->is_directory(stays)) std::filesystem::remove(entry->path(), stays);
  }
  std::filesystem::remove(folder, code);
}

// Makes the video of a take, and puts its lines in the order of the frames.
void complete_take(const JobFolder& folder, const Job& job, const JobTake& take,
                   std::ostream& out) {
  session::TakeClock clock;
  if (take.video) {
    post::RenderOptions options = folder.render_options(job, take);
    options.directory = take.pictures;
    options.frames = take.frames;
    clock = post::plan_render(options).clock;
  }
  constexpr post::FrameRange none{1, 0};  // all were looked at a moment ago
  post::RenderDirectory pictures(output_of(take, take.pictures, take.video), take.settings, false,
                                 clock, none);
  pictures.put_in_order();
  if (!take.video) return;
  std::vector<post::FinishedFrame> frames;
  for (std::uint64_t frame = take.frames.first; frame <= take.frames.last; ++frame)
    if (const post::FinishedFrame* finished = pictures.finished(frame)) frames.push_back(*finished);
  pictures.write_video(frames, out);
}

}  // namespace

Proof prove(const JobFolder& folder, const Job& job, Foreign foreign, std::ostream& out,
            const std::stop_token& stop) {
  Proof proof;
  for (std::size_t take = 0; take < job.takes.size(); ++take)
    TakeProof(folder, job, take, foreign, out, stop).run(proof);
  // The sums of a frame that is merged again are looked at again, and those that are there are
  // kept.
  const std::size_t merges = job.first_merge();
  std::set<std::pair<std::size_t, std::uint64_t>> merged;  // take and first frame
  for (auto at = proof.chunks.lower_bound(merges); at != proof.chunks.end(); ++at)
    merged.emplace(job.chunks[*at].take, job.chunks[*at].frames.first);
  for (std::size_t chunk = 0; chunk < merges && !merged.empty(); ++chunk)
    if (merged.contains({job.chunks[chunk].take, job.chunks[chunk].frames.first}))
      proof.chunks.insert(chunk);
  return proof;
}

void complete(const JobFolder& folder, const Job& job, std::ostream& out) {
  for (const JobTake& take : job.takes) complete_take(folder, job, take, out);
  for (std::size_t chunk = 0; chunk < job.chunks.size(); ++chunk)
    if (folder.taken(chunk) == Taken::no) remove_chunk(folder.chunk(chunk));
}

void write_missing(const JobFolder& folder, const Job& job, const Proof& proof) {
  if (proof.missing.empty()) {
    std::error_code stays;
    std::filesystem::remove(folder.missing_file(), stays);
    return;
  }
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const MissingFrames& missing : proof.missing)
    json.push_back({{"take", job.takes[missing.take].session.string()},
                    {"frames", missing.frames},
                    {"why", missing.why}});
  session::replace_file(folder.missing_file(),
                        json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

void print_missing(const JobFolder& folder, const Job& job, const Proof& proof, std::ostream& out) {
  for (const std::string& note : proof.notes) out << on_one_line(note) << std::endl;
  std::size_t count = 0;
  for (const MissingFrames& missing : proof.missing) {
    count += missing.frames.size();
    out << on_one_line(job.takes[missing.take].session.filename().string() + ": " +
                       post::frames_words(missing.frames) + ": " + missing.why)
        << std::endl;
  }
  if (count > 0)
    out << folder.path().string() << ": " << count << (count == 1 ? " frame is" : " frames are")
        << " missing; `previz farm retry` with this folder renders them" << std::endl;
}

int run_finish(const JobFolder& folder, const Job& job, std::ostream& out,
               const std::stop_token& stop) {
  const Proof proof = prove(folder, job, Foreign::keep, out, stop);
  write_missing(folder, job, proof);
  print_missing(folder, job, proof, out);
  if (!proof.missing.empty()) return task_status::machine_fault;
  complete(folder, job, out);
  out << folder.path().string() << ": every frame is there and whole" << std::endl;
  return task_status::done;
}

}  // namespace previz::farm
