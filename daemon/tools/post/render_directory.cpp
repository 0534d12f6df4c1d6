#include "daemon/tools/post/render_directory.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <set>
#include <utility>

#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/memory.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/output/sums_exr.hpp"
#include "daemon/core/output/video.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

// Returns what changes when anybody appends to the file or replaces it; empty: there is no file.
std::string state_of(const std::filesystem::path& file) {
  // Over NFS, stat(2) may return what was known seconds ago; after an opening it is what is there.
  const OwnedDescriptor open(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat now {};
  if (!open || ::fstat(open.get(), &now) != 0) return "";
  std::string state;
  for (const std::int64_t part :
       {static_cast<std::int64_t>(now.st_ino), static_cast<std::int64_t>(now.st_size),
        static_cast<std::int64_t>(now.st_mtim.tv_sec),
        static_cast<std::int64_t>(now.st_mtim.tv_nsec)})
    state += std::to_string(part) + " ";
  return state;
}

// A process that died while it appended may have left half a line.
void append_line(const std::filesystem::path& file, const std::string& line) {
  const session::OpenFile lines(file, O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK);
  const off_t size = ::lseek(lines.get(), 0, SEEK_END);
  char last = '\n';
  const bool is_torn = size > 0 && ::pread(lines.get(), &last, 1, size - 1) == 1 && last != '\n';
  lines.append((is_torn ? "\n" : "") + line + "\n");
  lines.sync();
}

}  // namespace

// What takes long, the reading of the pictures, is done while others may go on.
RenderDirectory::RenderDirectory(const set::Output& output, const std::string& settings, bool force,
                                 const session::TakeClock& clock, FrameRange range,
                                 const std::stop_token& stop,
                                 std::optional<render::SampleRange> sample_range)
    : output_(output), clock_(clock), sample_range_(sample_range), range_(range) {
  std::error_code code;
  std::filesystem::create_directories(path(), code);
  if (!std::filesystem::is_directory(path()))
    throw Error(path().string() + ": cannot be created: " + code.message());
  for (const char* name : {settings_name, lines_name})
    if (const std::string why = session::why_not_plain(path() / name); !why.empty())
      throw Error((path() / name).string() + ": " + why);
  const std::vector<std::string> drafts = session::remove_dead_drafts(path());
  if (!drafts.empty()) {
    std::string names;
    for (const std::string& name : drafts) add_to_list(names, name);
    notes_.push_back("removed, half written by a process that was killed: " + names);
  }
  locks_.emplace(path());
  if (!locks_->missing().empty()) notes_.push_back(locks_->missing());
  begin(settings, force, range, stop);
  verify(range, stop);
}

// Finds out whether the pictures of this run may go beside what is there, and joins.
void RenderDirectory::begin(const std::string& settings, bool force, FrameRange range,
                            const std::stop_token& stop) {
  const FolderLocks::Transaction transaction(*locks_, stop);
  const std::vector<FolderUser> others = locks_->others();
  has_others_ = !others.empty();
  std::string who;
  for (const FolderUser& user : others) add_to_list(who, words_of(user), "; ");
  if (!who.empty()) notes_.push_back("also at work here: " + who);
  read_lines();
  const std::string name = (path() / settings_name).string();
  const bool is_new = finished_.empty() && others.empty();
  const std::string differ = is_new ? "" : differences_from(settings);
  if (!differ.empty() && !others.empty())
    throw Error(name + ": other settings are being rendered there (" + differ + ") by " + who +
                "; give another folder with --out, or wait until they have ended");
  if (!differ.empty() && !force)
    throw Error(name + ": its frames were rendered with other settings (" + differ +
                "); give another folder with --out, or render them again with --force");
  if (force && !others.empty())
    notes_.push_back(
        "--force is ignored while others are at work here, so that what they finish "
        "stays; use it with the first command only");
  if (force && others.empty()) {
    if (!differ.empty())
      finished_.clear();
    else
      finished_.erase(finished_.lower_bound(range.first), finished_.upper_bound(range.last));
    write_lines(finished_);
  }
  if (is_new || !differ.empty()) session::replace_file(path() / settings_name, settings);
  locks_->join();
}

std::string RenderDirectory::differences_from(const std::string& settings) const {
  const std::filesystem::path name = path() / settings_name;
  std::error_code unknown;
  if (!std::filesystem::exists(name, unknown)) return "it cannot be read";
  const auto there = nlohmann::json::parse(read_settings(path()), nullptr,
                                           /*allow_exceptions=*/false);
  return there.is_object() ? differences(there, nlohmann::json::parse(settings))
                           : "it cannot be read";
}

void RenderDirectory::read_lines() {
  const std::string state = state_of(path() / lines_name);
  if (state == lines_state_) return;
  finished_ = frames_in(path() / lines_name);
  lines_state_ = state;
}

void RenderDirectory::write_lines(const Frames& frames) const {
  std::string lines;
  for (const auto& [frame, record] : frames) lines += to_json(record) + "\n";
  session::replace_file(path() / lines_name, lines);
}

// Reads the pictures without the locks. What another process has done to a frame meanwhile holds.
void RenderDirectory::verify(FrameRange range, const std::stop_token& stop) {
  std::map<std::uint64_t, std::string> before, why_not;
  std::map<std::uint64_t, FinishedFrame> read = finished_;
  for (auto at = read.lower_bound(range.first); at != read.end() && at->first <= range.last; ++at) {
    if (stop.stop_requested())
      throw Error(path().string() +
                  ": interrupted while the finished frames were checked; nothing was changed, the "
                  "same command starts again");
    auto& [frame, record] = *at;
    before[frame] = to_json(record);
    const bool has_marks = !record.files.empty();
    std::string& why = why_not[frame];
    for (const char* extension : extensions(record.status))
      if (why.empty()) why = why_broken(file(frame, extension), has_marks, record);
  }

  const FolderLocks::Transaction transaction(*locks_, stop);
  read_lines();
  bool has_changed = false;
  for (const auto& [frame, why] : why_not) {
    const auto now = finished_.find(frame);
    if (now == finished_.end() || to_json(now->second) != before[frame] ||
        locks_->is_at_another(frame))
      continue;
    has_changed |= !why.empty() || now->second.files.empty();
    now->second = read[frame];
    if (why.empty()) continue;
    rejected_[why].push_back(frame);
    finished_.erase(now);
  }
  reject_without_line(range);
  if (!has_changed) return;
  write_lines(finished_);
  lines_state_ = state_of(path() / lines_name);
}

void RenderDirectory::reject_without_line(FrameRange range) {
  std::set<std::uint64_t> frames, broken;
  for (const auto& [why, of_these] : rejected_) broken.insert(of_these.begin(), of_these.end());
  for (const auto& entry : std::filesystem::directory_iterator(path())) {
    const std::optional<std::uint64_t> frame = frame_of(entry.path().filename());
    if (!frame || *frame < range.first || *frame > range.last || finished_.contains(*frame) ||
        broken.contains(*frame) || locks_->is_at_another(*frame))
      continue;
    for (const char* extension : extensions(FrameStatus::rendered))
      if (file(*frame, extension).filename() == entry.path().filename()) frames.insert(*frame);
  }
  if (!frames.empty())
    rejected_["it has no complete line in " + std::string(lines_name)].assign(frames.begin(),
                                                                              frames.end());
}

std::vector<const char*> RenderDirectory::extensions(FrameStatus status) const {
  return extensions_of(output_, sample_range_.has_value(), status);
}

std::filesystem::path RenderDirectory::file(std::uint64_t frame, const char* extension) const {
  return path() / frame_file(frame, extension);
}

const FinishedFrame* RenderDirectory::finished(std::uint64_t frame) const {
  const auto found = finished_.find(frame);
  if (found == finished_.end()) return nullptr;
  const bool is_there = has_files(output_, sample_range_.has_value(), found->second);
  return is_there ? &found->second : nullptr;
}

std::set<std::uint64_t> RenderDirectory::claim(const std::set<std::uint64_t>& frames,
                                               std::uint64_t most) {
  const std::lock_guard guard(mutex_);
  const FolderLocks::Transaction transaction(*locks_);
  read_lines();
  std::set<std::uint64_t> unfinished;
  for (const std::uint64_t frame : frames)
    if (!finished(frame)) unfinished.insert(frame);
  return locks_->claim(unfinished, most);
}

void RenderDirectory::release(std::uint64_t frame) {
  const std::lock_guard guard(mutex_);
  const FolderLocks::Transaction transaction(*locks_);
  locks_->release(frame);
}

std::map<std::string, std::vector<std::uint64_t>> RenderDirectory::at_others(
    const std::set<std::uint64_t>& frames) {
  const std::lock_guard guard(mutex_);
  const FolderLocks::Transaction transaction(*locks_);
  read_lines();
  const std::vector<FolderUser> others = locks_->others();
  std::map<std::string, std::vector<std::uint64_t>> held;
  for (const std::uint64_t frame : frames) {
    if (finished(frame) || !locks_->is_at_another(frame)) continue;
    const auto user = std::ranges::find_if(
        others, [&](const FolderUser& other) { return other.frames.contains(frame); });
    held[words_of(user == others.end() ? FolderUser{} : *user)].push_back(frame);
  }
  return held;
}

bool RenderDirectory::claim_video() {
  const std::lock_guard guard(mutex_);
  const FolderLocks::Transaction transaction(*locks_);
  return locks_->claim_video();
}

void RenderDirectory::write_files(const pipeline::Shot& shot, const set::Set& set) const {
  if (sample_range_) {
    if (shot.sums)
      output::write_sums_exr(file(shot.index, sums_extension),
                             {shot.index, *sample_range_, *shot.sums});
    return;
  }
  if (output_.exr) {
    output::ExrMetadata metadata = output::exr_metadata(*shot.layers, *shot.frame, shot.track, set);
    metadata.fps = clock_.fps;
    metadata.timecode = clock_.at(shot.frame->timestamp_ns);
    output::write_exr(file(shot.index, ".exr"), *shot.layers, metadata);
  }
  if (output_.png || output_.video) output::write_png(file(shot.index, ".png"), *shot.picture);
}

void RenderDirectory::write(const pipeline::Shot& shot, const set::Set& set,
                            const MadeOn& made_on) {
  write_files(shot, set);
  FinishedFrame record = finished_frame(shot);
  record.made_on = made_on;
  record.peak_memory_bytes = output::peak_memory_bytes();
  for (const char* extension : extensions(record.status)) {
    const std::filesystem::path written = file(shot.index, extension);
    record.files[written.filename().string()] = mark_of(written);
  }
  const std::lock_guard guard(mutex_);
  const FolderLocks::Transaction transaction(*locks_);
  read_lines();
  append_line(path() / lines_name, to_json(record));
  finished_[record.frame] = record;
  lines_state_ = state_of(path() / lines_name);
  locks_->release(record.frame);
}

std::vector<FinishedFrame> RenderDirectory::reject(
    const std::function<bool(const FinishedFrame&)>& is_such) {
  const std::lock_guard guard(mutex_);
  std::vector<FinishedFrame> rejected;
  for (auto at = finished_.lower_bound(range_.first);
       at != finished_.end() && at->first <= range_.last;) {
    const auto next = std::next(at);
    if (is_such(at->second)) rejected.push_back(finished_.extract(at).mapped());
    at = next;
  }
  return rejected;
}

// The lines of others that reject() counts as not finished stay.
void RenderDirectory::forget(const std::vector<FinishedFrame>& frames) {
  const std::lock_guard guard(mutex_);
  const FolderLocks::Transaction transaction(*locks_);
  Frames lines = frames_in(path() / lines_name);
  for (const FinishedFrame& frame : frames) {
    lines.erase(frame.frame);
    finished_.erase(frame.frame);
  }
  write_lines(lines);
  lines_state_ = state_of(path() / lines_name);
}

void RenderDirectory::put_in_order() {
  const std::lock_guard guard(mutex_);
  const FolderLocks::Transaction transaction(*locks_);
  read_lines();
  write_lines(finished_);
  lines_state_ = state_of(path() / lines_name);
}

std::filesystem::path RenderDirectory::write_video(const std::vector<FinishedFrame>& frames,
                                                   std::ostream& out) const {
  const std::vector<output::VideoCodec> codecs = output::review_codecs();
  if (codecs.empty())
    throw Error(
        (path() / "review").string() +
        ": libav has none of the encoders libx264, mpeg4 and ffv1; set output.video = false");
  std::optional<output::VideoWriter> video;
  for (const FinishedFrame& frame : frames) {
    const Plate picture = output::read_png(file(frame.frame, ".png"));
    if (!video)
      video.emplace(path() / "review", picture.width, picture.height, codecs.front(), clock_,
                    frame.timestamp_ns);
    video->write(picture, frame.timestamp_ns);
  }
  std::filesystem::path written = video->close();
  out << written.string() << ": " << set::plural(frames.size(), "picture") << ", "
      << codecs.front().description << std::endl;
  if (clock_.timecode && !session::counts_frames(clock_))
    out << "  without timecode: the take's counts " << clock_.timecode->fps
        << " frames per second (recording.timecode_fps), and it has " << clock_.fps << std::endl;
  return written;
}

}  // namespace previz::post
