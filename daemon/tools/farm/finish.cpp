#include "daemon/tools/farm/finish.hpp"

#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <set>
#include <thread>

#include "daemon/core/report/printable.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/timecode.hpp"
#include "daemon/tools/farm/task.hpp"
#include "daemon/tools/post/render_directory.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "daemon/tools/post/render_plan.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Why frames are missing that nobody is rendering, as far as tasks have said.
std::string why_not_rendered(const JobFolder& folder) {
  std::set<std::string> reasons;
  for (const auto& [name, state] : folder.read_states())
    if (!state.message.empty()) reasons.insert("on " + state.host + ": " + state.message);
  std::string words;
  for (const std::string& reason : reasons) add_to_list(words, reason, "; ");
  return words.empty()
             ? "not rendered: no task has come to them, or what came was stopped or killed"
             : words;
}

std::string why_foreign(const post::FinishedFrame& frame, const Job& job, Foreign foreign) {
  return "was rendered on " + frame.made_on.device + ", and the job is rendered on " +
         (job.on_gpu ? "graphics cards" : "processors") +
         (foreign == Foreign::refuse ? "; --any-device takes both, --force renders all again, and "
                                       "--out gives another folder"
                                     : "; `previz farm finish --any-device` takes both, and "
                                       "`previz farm retry` renders it "
                                       "again");
}

using Reasons = std::map<std::uint64_t, std::string>;  // why a frame is missing

// Returns why frames of another kind of device are not taken.
Reasons reject_foreign(const Job& job, post::RenderDirectory& pictures, Foreign foreign) {
  if (job.any_device) return {};
  const std::vector<post::FinishedFrame> frames = pictures.reject(
      [&](const post::FinishedFrame& frame) { return frame.made_on.is_gpu != job.on_gpu; });
  if (foreign == Foreign::forget && !frames.empty()) pictures.forget(frames);
  Reasons reasons;
  for (const post::FinishedFrame& frame : frames)
    reasons[frame.frame] = why_foreign(frame, job, foreign);
  if (foreign == Foreign::refuse && !frames.empty())
    throw Error(pictures.path().string() + ": frame " + std::to_string(frames.front().frame) +
                ": " + reasons[frames.front().frame]);
  return reasons;
}

// Looks at the sums of frames that are to be merged: those that are not whole are rendered again.
void prove_sums(const JobFolder& folder, const Job& job, std::size_t index,
                const std::stop_token& stop) {
  const post::FrameRange frames = job.takes[index].frames;
  for (int range = 1; job.sample_ranges > 1 && range <= job.sample_ranges; ++range) {
    const std::filesystem::path sums = folder.sums(index, range);
    if (std::filesystem::exists(sums / post::settings_name))
      post::RenderDirectory({sums, true, false, false}, post::read_settings(sums), false, {},
                            frames, stop, render::SampleRange{range, job.sample_ranges});
  }
}

void prove_take(const JobFolder& folder, const Job& job, std::size_t index, Foreign foreign,
                std::ostream& out, const std::stop_token& stop, Proof& proof) {
  const JobTake& take = job.takes[index];
  post::RenderDirectory pictures({take.pictures, take.exr, take.png, false}, take.settings, false,
                                 {}, take.frames, stop);
  Reasons reasons = reject_foreign(job, pictures, foreign);
  for (const auto& [why, frames] : pictures.rejected()) {
    out << on_one_line(take.pictures.string() + ": " + post::frames_words(frames) + ": " + why)
        << std::endl;
    for (const std::uint64_t frame : frames) reasons[frame] = why;
  }
  std::set<std::uint64_t> unfinished;
  std::set<std::string> devices;
  for (std::uint64_t frame = take.frames.first; frame <= take.frames.last; ++frame)
    if (const post::FinishedFrame* finished = pictures.finished(frame))
      devices.insert(finished->made_on.device.empty() ? "unknown" : finished->made_on.device);
    else
      unfinished.insert(frame);
  for (const auto& [who, frames] : pictures.at_others(unfinished))
    for (const std::uint64_t frame : frames) reasons[frame] = "is being rendered by " + who;
  const std::string otherwise = unfinished.empty() ? "" : why_not_rendered(folder);
  std::map<std::string, MissingFrames> missing;
  for (const std::uint64_t frame : unfinished) {
    const auto reason = reasons.find(frame);
    const std::string& why = reason == reasons.end() ? otherwise : reason->second;
    MissingFrames& these = missing[why];
    these.take = index;
    these.why = why;
    these.frames.push_back(frame);
  }
  for (auto& [why, frames] : missing) proof.missing.push_back(std::move(frames));
  if (!unfinished.empty()) prove_sums(folder, job, index, stop);
  if (devices.size() < 2) return;
  std::string names;
  for (const std::string& device : devices) add_to_list(names, device);
  proof.notes.push_back(take.pictures.string() + ": rendered on " + names +
                        ", whose pictures differ in the last bits");
}

// Makes the video of a take, and puts its lines in the order of the frames.
void complete_take(const JobFolder& folder, const Job& job, const JobTake& take,
                   std::ostream& out) {
  session::TakeClock clock;
  if (take.video) clock = post::plan_render(folder.render_options(job, take)).clock;
  // All pictures were looked at a moment ago.
  post::RenderDirectory pictures({take.pictures, take.exr, take.png, take.video}, take.settings,
                                 false, clock, post::no_frames);
  pictures.put_in_order();
  if (!take.video) return;
  std::vector<post::FinishedFrame> frames;
  for (std::uint64_t frame = take.frames.first; frame <= take.frames.last; ++frame)
    if (const post::FinishedFrame* finished = pictures.finished(frame))
      frames.push_back(*finished);
    else
      throw Error(take.pictures.string() + ": frame " + std::to_string(frame) +
                  " was whole a moment ago and is gone, so that there is no review video; run the "
                  "last step again");
  pictures.write_video(frames, out);
}

// Removes what `previz render` leaves in a folder of sums, and the folder if nothing else is in it.
void remove_sums(const std::filesystem::path& folder) {
  if (!post::users_of(folder).empty()) return;  // that came late, and finds all frames finished
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

int prove_and_complete(const JobFolder& folder, const Job& job, std::ostream& out,
                       const std::stop_token& stop) {
  const Proof proof = prove(folder, job, Foreign::keep, out, stop);
  write_missing(folder, job, proof);
  print_missing(folder, job, proof, out);
  if (!proof.missing.empty()) return task_status::machine_fault;
  complete(folder, job, out);
  out << folder.path().string() << ": every frame is there and whole" << std::endl;
  return task_status::done;
}

}  // namespace

std::uint64_t Proof::missing_frames() const {
  std::uint64_t count = 0;
  for (const MissingFrames& these : missing) count += these.frames.size();
  return count;
}

Proof prove(const JobFolder& folder, const Job& job, Foreign foreign, std::ostream& out,
            const std::stop_token& stop) {
  Proof proof;
  for (std::size_t take = 0; take < job.takes.size(); ++take)
    prove_take(folder, job, take, foreign, out, stop, proof);
  return proof;
}

void complete(const JobFolder& folder, const Job& job, std::ostream& out) {
  std::error_code others;
  for (std::size_t take = 0; take < job.takes.size(); ++take) {
    complete_take(folder, job, job.takes[take], out);
    for (int range = 1; range <= job.sample_ranges; ++range) remove_sums(folder.sums(take, range));
    std::filesystem::remove(folder.sums(take, 1).parent_path(), others);
  }
  std::filesystem::remove(folder.place("sums"), others);
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
  for (const MissingFrames& missing : proof.missing)
    out << on_one_line(job.takes[missing.take].session.filename().string() + ": " +
                       post::frames_words(missing.frames) + ": " + missing.why)
        << std::endl;
  if (const std::uint64_t count = proof.missing_frames(); count > 0)
    out << folder.path().string() << ": " << count << (count == 1 ? " frame is" : " frames are")
        << " missing; `previz farm retry` with this folder renders them" << std::endl;
}

// Takes the lock of frame 0, which means nothing else in a job's own folder. It is asked for again
// and again, since a lock that fcntl(2) waits for could not be given up on a stop.
JobLock::JobLock(const JobFolder& folder, std::ostream& out, const std::stop_token& stop)
    : locks_(folder.path()) {
  for (;; std::this_thread::sleep_for(std::chrono::milliseconds(100))) {
    const post::FolderLocks::Transaction transaction(locks_, stop);
    if (!has_waited_) locks_.join();
    if (!locks_.claim({0}, 1).empty()) return;
    for (const post::FolderUser& other : locks_.others())
      if (!has_waited_ && other.frames.contains(0))
        out << folder.path().string() << ": waits for the last step or retry of " << words_of(other)
            << std::endl;
    has_waited_ = true;
    if (stop.stop_requested())
      throw Error(folder.path().string() + ": interrupted while another last step was at work");
  }
}

int finish(const JobOptions& options, std::ostream& out) {
  const JobFolder folder(options.job);
  Job job = folder.read_plan();
  job.any_device |= options.any_device;
  check_paths(folder, job, options.any_paths);
  const auto say = [&](TaskOutcome outcome, const std::string& message) {
    folder.write_state(finish_name, state_now(outcome, post::host_name(), message));
  };
  std::optional<JobLock> lock;  // what only waits for it has nothing to say of the last step
  try {
    lock.emplace(folder, out, options.stop);
    const std::optional<TaskState> before = folder.read_state(finish_name);
    if (lock->has_waited() && before && before->outcome == TaskOutcome::done) {
      out << folder.path().string() << ": another machine has just done the last step" << std::endl;
      return task_status::done;
    }
    say(TaskOutcome::running, "");
    const int status = prove_and_complete(folder, job, out, options.stop);
    const bool is_done = status == task_status::done;
    say(is_done ? TaskOutcome::done : TaskOutcome::machine, is_done ? "" : "frames are missing");
    return status;
  } catch (const JobFault&) {
    throw;
  } catch (const std::exception& error) {
    out << error.what() << std::endl;
    try {
      const bool was_stopped = options.stop.stop_requested();
      if (lock) say(was_stopped ? TaskOutcome::stopped : TaskOutcome::machine, error.what());
    } catch (const Error& full) {
      out << full.what() << std::endl;
    }
    return task_status::machine_fault;
  }
}

}  // namespace previz::farm
