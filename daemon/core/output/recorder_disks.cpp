// What the recorder does about its disks.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "daemon/core/output/recorder.hpp"
#include "drivers/error.hpp"

namespace previz::output {

using report::Severity;

namespace {

// A disk that does not answer for longer is not waited for to know what there is.
constexpr double longest_wait_s = 1;

std::string megabytes(double bytes) {
  return std::to_string(std::lround(1e-6 * bytes)) + " MB";
}

}  // namespace

void Recorder::drop_wish() {
  for (const auto& watch : watches_) watch->drop_wish();
}

std::vector<FolderSeen> Recorder::folders() const {
  std::vector<FolderSeen> seen;
  for (const auto& watch : watches_) seen.push_back(watch->seen());
  return seen;
}

// What a folder was told of takes elsewhere counts only where one of them is not there to be asked.
int Recorder::highest_known_number() const {
  const std::vector<FolderSeen> seen = folders();
  const bool are_all_there = std::ranges::all_of(seen, &FolderSeen::is_own);
  int highest = highest_number_;
  for (const FolderSeen& folder : seen)
    highest = std::max({highest, folder.highest_number, are_all_there ? 0 : folder.kept_number});
  return highest;
}

// Returns the number of a take that begins in the folder, which may not have been looked at yet.
int Recorder::next_number_in(std::size_t folder) const {
  const std::string slate = options_.take.info.take.value_or(session::TakeInfo{}).slate;
  const std::filesystem::path& path = folders_.all()[folder];
  const bool is_looked_at = watches_[folder]->seen().is_own;
  const int kept = is_looked_at ? 0 : TakeFolders({path}, 0, {}).kept_number(slate);
  return next_take_number({path}, slate, std::max(highest_known_number(), kept));
}

// Tells each of two folders the highest number of all takes, for a start without the other.
void Recorder::keep_numbers(const std::vector<FolderSeen>& seen) {
  if (seen.size() < 2) return;
  const int highest = highest_known_number();
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i].is_own || kept_numbers_[i] >= highest) continue;
    watches_[i]->keep_number(highest);
    kept_numbers_[i] = highest;
  }
}

// A folder in which another process records is left to that.
std::string Recorder::why_not_own(std::size_t folder) {
  const std::string why_not = watches_[folder]->hold();
  return why_not.empty() ? "" : folders_.all()[folder].string() + ": " + why_not;
}

void Recorder::take_news() {
  const std::vector<FolderSeen> seen = folders();
  const bool are_known = std::ranges::all_of(seen, [](const FolderSeen& folder) {
    return folder.is_looked_at || folder.silent_s > longest_wait_s;
  });
  look_for_interruption(seen, are_known);
  keep_numbers(seen);
  if (are_known) {
    const std::optional<std::uint64_t> left = folders_.free_bytes(seen);
    const std::lock_guard lock(mutex_);
    free_bytes_ = left;
  }
  if (options_.measures_disk && !take_ && ending_.empty() && !has_compared_speeds_)
    compare_speeds();
  if (!take_) return;
  const std::string gone = seen[take_->folder].take_gone;
  if (!gone.empty() && !goes_on_elsewhere(gone)) fail(gone);
}

// Takes that the last process could not end, and its wish to record. Once a take was begun, an
// older wish is none; and a disk that does not answer is not waited for.
void Recorder::look_for_interruption(const std::vector<FolderSeen>& seen, bool are_known) {
  std::optional<KeptWish> newest;
  for (const FolderSeen& folder : seen)
    if (folder.wish && (!newest || folder.wish->time > newest->time)) newest = folder.wish;
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < seen.size(); ++i)
    for (; told_[i] < seen[i].salvaged.size(); ++told_[i])
      status_.salvaged.push_back(seen[i].salvaged[told_[i]]);
  if (are_known && newest && begun_ == 0 && !status_.interrupted)
    status_.interrupted = newest->take;
}

// After a failure of the running take's disk: leaves that take and begins the next one on the next
// disk, if there is one. Returns whether it goes on.
bool Recorder::goes_on_elsewhere(const std::string& why) {
  if (!take_) return false;
  const std::filesystem::path folder = folders_.all()[take_->folder];
  if (!folders_.give_up(take_->folder, folder.string() + ": its disk failed")) return false;
  const std::string failed = take_->writer->directory().filename().string();
  abandon(*take_, why);
  {
    const std::lock_guard lock(mutex_);
    count_finished(*take_);
  }
  take_.reset();
  try {
    begin_take(true);
  } catch (const std::exception& error) {
    note(Severity::error, std::string("recording cannot continue elsewhere: ") + reason_of(error));
    return false;
  }
  note(Severity::error, failed + " ended: " + why + "; recording continues in " +
                            take_->writer->directory().string());
  return true;
}

// Ends the take properly while there is still room on its disk, and goes on where there is more.
// The room that the end of the take gives back is no reason to begin there again.
void Recorder::check_disk() {
  checked_ = Clock::now();
  const std::size_t folder = take_->folder;
  const std::string full = folders_.why_full(folder);
  if (full.empty()) return;
  folders_.give_up(folder, full);
  const std::string name = take_->writer->directory().filename().string();
  begin_next_take();
  note(Severity::warning, "the disk of " + name + " is almost full; recording continues in " +
                              take_->writer->directory().string());
}

// Compares what the cameras deliver, by the ring, with what encoder and disk take together.
void Recorder::compare_speeds() {
  constexpr double least_length_s = 0.5;
  double bytes_a_s = 0;
  std::vector<FramePtr> frames;
  {
    const std::lock_guard lock(mutex_);
    const double length_s = queue_.ring_length_s();
    if (status_.recording || length_s <= 0) return;
    if (length_s < std::min(least_length_s, 0.5 * options_.preroll_s)) return;
    bytes_a_s = static_cast<double>(queue_.ring_bytes()) / length_s;
    frames = queue_.newest_of_ring(least_length_s);
  }
  if (frames.size() < 2 || frames.back()->timestamp_ns <= frames.front()->timestamp_ns) return;
  has_compared_speeds_ = true;
  const auto span_ns = frames.back()->timestamp_ns - frames.front()->timestamp_ns;
  const double delivered =
      1e9 * static_cast<double>(frames.size() - 1) / static_cast<double>(span_ns);
  try {
    const std::optional<double> taken = folders_.measure_frame_rate(frames, options_.take.codec);
    if (taken && *taken < delivered) note_slow(*taken, delivered, bytes_a_s);
  } catch (const std::exception& error) {
    note(Severity::warning,
         std::string("the disk's speed cannot be measured: ") + reason_of(error));
  }
}

void Recorder::note_far_behind() const {
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(),
                "the disk or the encoder is too slow: the recording is %.1f s behind the cameras "
                "(recording.most_behind_s), and frames are dropped",
                options_.most_behind_s);
  note(Severity::warning, text.data());
}

void Recorder::note_slow(double taken, double delivered, double bytes_a_s) {
  std::array<char, 160> figures{};
  std::snprintf(
      figures.data(), figures.size(),
      "encoder and disk write %.3g frames per second, but the cameras deliver %.3g: takes "
      "will miss frames",
      taken, delivered);
  std::string text = figures.data();
  if (options_.take.codec == session::VideoCodec::ffv1) {
    const std::optional<double> disk = folders_.measure_speed();
    if (disk)
      text += "; recording.codec = \"raw\" needs no encoder and a disk of " + megabytes(bytes_a_s) +
              " per second; this one writes " + megabytes(*disk);
  } else {
    text += "; it needs a faster disk, or recording.codec = \"ffv1\", which is smaller";
  }
  note(Severity::warning, text);
}

std::optional<std::uint64_t> Recorder::free_bytes() const {
  const std::lock_guard lock(mutex_);
  return free_bytes_;
}

}  // namespace previz::output
