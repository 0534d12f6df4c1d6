#include "daemon/tools/exchange/import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>

#include "daemon/core/scene/assets.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/nominal_rate.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/core/tracking/pose_judgement.hpp"
#include "daemon/core/tracking/trackers.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/import_description.hpp"
#include "daemon/tools/exchange/size_reason.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

namespace fs = std::filesystem;

fs::path without_slash(const fs::path& folder) {
  return folder.has_filename() ? folder : folder.parent_path();
}

void check_target(const fs::path& target) {
  if (fs::exists(target) && !(fs::is_directory(target) && fs::is_empty(target)))
    throw Error(target.string() + ": already exists; choose another name for the session");
  std::error_code seen_later;
  fs::create_directories(target.parent_path(), seen_later);
}

std::uintmax_t size_of(const fs::path& folder) {
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

double one_of(const std::vector<double>& series, std::size_t i, double none) {
  if (series.empty()) return none;
  return series.size() == 1 ? series[0] : series[i];
}

// More than any timecode counts.
constexpr double most_timecode_frames = 1e15;

struct Size {
  int width = 0, height = 0;
};

std::string text(PixelFormat format, int width, int height) {
  return std::string(to_string(format)) + " " + std::to_string(width) + "x" +
         std::to_string(height);
}

struct ImportedFrame {
  std::uint64_t number = 0;  // in the footage, from 0; lost frames count
  std::int64_t timestamp_ns = 0;
};
struct Imported {
  std::vector<ImportedFrame> frames;
  std::uint64_t in_footage = 0;  // with those that are lost
  session::NominalRate rate;
  std::optional<session::Timecode> timecode;  // of the first of these frames
  std::vector<FramePtr> to_judge;             // few
};

// Tags are looked for in this frame, and again each time that the take has become three times as
// long, which takes a fiftieth of the time that importing takes.
constexpr std::size_t first_judged = 50;

// Reads one camera's footage and writes it into the session.
class FootageImport {
 public:
  // The size in the set, unlike that in FRAMES.json, refuses nothing: the set may be replaced.
  FootageImport(const fs::path& description_file, const FootageDescription& footage,
                std::optional<Size> calibrated, std::optional<Size> in_set,
                session::SessionWriter& writer)
      : file_(description_file),
        footage_(footage),
        calibrated_(calibrated),
        in_set_(in_set),
        writer_(writer) {}

  Imported run(std::vector<std::string>& notes) {
    const auto pictures = footage_.videos.empty()
                              ? open_pictures(footage_.pictures, footage_.read_as)
                              : open_videos(footage_.videos, footage_.read_as);
    std::vector<ImportedFrame> frames;
    std::vector<FramePtr> to_judge;
    std::size_t next_judged = first_judged;
    while (const auto picture = pictures->next()) {
      check(*picture, *pictures, notes);
      const std::size_t i = picture->number;
      check_count(i, *picture);
      Frame frame;
      frame.source = footage_.source;
      frame.sequence = i;
      frame.timestamp_ns = frame.arrival_ns = time_of(i, *picture, frames);
      frame.exposure = one_of(footage_.exposure, i, 1);
      frame.exposure_s = one_of(footage_.exposure_s, i, 0);
      frame.gain = one_of(footage_.gain, i, 1);
      frame.format = picture->format;
      frame.width = picture->width;
      frame.height = picture->height;
      frame.bytes = picture->bytes;
      writer_.write(frame);
      if (frames.size() == next_judged) {
        to_judge.push_back(std::make_shared<const Frame>(frame));
        next_judged *= 3;
      }
      frames.push_back({i, frame.timestamp_ns});
      if (picture->container_ns)
        farthest_ns_ = std::max(farthest_ns_, std::abs(static_cast<double>(*picture->container_ns) -
                                                       static_cast<double>(frame.timestamp_ns) +
                                                       static_cast<double>(footage_.start_ns)));
    }
    if (frames.empty()) fail("holds no frame");
    const std::uint64_t all = frames.size() + pictures->lost();
    if (listed() > 0 && all != listed())
      fail("has " + set::plural(all, "frame") + ", and not the " + std::to_string(listed()) +
           " described");
    for (const std::string& note : pictures->notes()) notes.push_back(note);
    note_replaced_times(notes);
    Imported imported{std::move(frames), all, {}, {}, std::move(to_judge)};
    read_times(imported, *pictures, notes);
    return imported;
  }

 private:
  // A rate that is given counts frames, and so does not see those that are missing in the file.
  void note_replaced_times(std::vector<std::string>& notes) const {
    if (footage_.fps > 0 && farthest_ns_ > 0.5e9 / footage_.fps)
      notes.push_back(
          fmt::format("{}: {}.fps = {:g} takes the place of the times in {}, which are up to "
                      "{:.3g} s away: the "
                      "clip has another rate, or lacks frames; without fps its own times hold",
                      file_.string(), footage_.source, footage_.fps,
                      footage_.videos.front().string(), farthest_ns_ / 1e9));
  }

  // The rate and the timecode of what was imported.
  void read_times(Imported& imported, const Footage& pictures, std::vector<std::string>& notes) {
    std::vector<std::int64_t> times;
    for (const ImportedFrame& frame : imported.frames) times.push_back(frame.timestamp_ns);
    imported.rate = session::nominal_rate(times);
    if (times.size() > 1)
      notes.push_back(footage_.source + ": " + session::words_of(imported.rate));
    const auto first = pictures.timecode();
    if (!first) return;
    const session::Timecode of_file{first->first, imported.rate.fps};
    const double after = static_cast<double>(imported.frames.front().number) +
                         static_cast<double>(first->frames) + first->seconds * of_file.fps;
    const std::int64_t number =
        std::llround(std::clamp(after, -most_timecode_frames, most_timecode_frames));
    const auto digits = session::timecode_after(of_file, number);
    if (digits)
      imported.timecode = session::Timecode{session::words_of(*digits), of_file.fps};
    else
      notes.push_back(footage_.source + ": its timecode, " + set::printable(first->first) +
                      ", does not fit this rate and is skipped");
  }

  // Returns how many frames the lists are for; 0 if there are no lists.
  std::size_t listed() const {
    std::size_t count = footage_.timestamps_ns.size();
    for (const auto* series : {&footage_.exposure, &footage_.exposure_s, &footage_.gain})
      if (series->size() > 1) count = std::max(count, series->size());
    return count;
  }

  void check_count(std::size_t i, const Picture& picture) const {
    if (listed() > 0 && i >= listed())
      throw Error(picture.name + ": exceeds the " + set::plural(listed(), "frame") + " that " +
                  file_.string() + " describes under " + footage_.source);
  }

  // Returns what is wrong with the picture's size, or "".
  std::string misfit(const Picture& picture, const Footage& pictures, std::optional<Size> size,
                     const std::string& where) const {
    if (!size || (picture.width == size->width && picture.height == size->height)) return "";
    return fmt::format(
        "{}: is {}x{}; {}: {}.intrinsics is for {}x{}{}", picture.name, picture.width,
        picture.height, where, footage_.source, size->width, size->height,
        size_reason(picture.width, picture.height, size->width, size->height, pictures.shape()));
  }

  void check(const Picture& picture, const Footage& pictures, std::vector<std::string>& notes) {
    if (const std::string fault = misfit(picture, pictures, calibrated_, file_.string());
        !fault.empty())
      throw Error(fault);
    if (first_.empty() && !calibrated_)
      if (const std::string fault = misfit(picture, pictures, in_set_, "the set file");
          !fault.empty())
        notes.push_back(fault);
    const std::string is = text(picture.format, picture.width, picture.height);
    if (first_.empty()) first_ = is;
    if (is != first_)
      throw Error(picture.name + ": is " + is + "; all pictures of " + footage_.source +
                  " must be " + first_ + " like the first" +
                  (footage_.videos.empty()
                       ? " (those whose colours are converted, by a profile or another tag, have "
                         "16 bits: give all the same tag)"
                       : ""));
  }

  std::int64_t time_of(std::size_t i, const Picture& picture,
                       const std::vector<ImportedFrame>& before) const {
    if (!footage_.timestamps_ns.empty()) return footage_.timestamps_ns[i];
    const double since_start = footage_.fps > 0       ? std::round(double(i) / footage_.fps * 1e9)
                               : picture.container_ns ? double(*picture.container_ns)
                                                      : 0;
    if (!(since_start < static_cast<double>(latest_ns - footage_.start_ns)))
      throw Error(picture.name + ": its time does not fit into 64 bits of nanoseconds, " +
                  "292 years; check " + footage_.source + ".start_ns and fps in " + file_.string() +
                  ", or give timestamps_ns");
    if (footage_.fps > 0) return footage_.start_ns + static_cast<std::int64_t>(since_start);
    if (!picture.container_ns)
      throw Error(picture.name +
                  ": has no time stamp in its file (a bare stream such as .h264 has none, and an "
                  "AVI file not all); give \"fps\", the clip's rate, beside \"video\" in " +
                  file_.string());
    const std::int64_t time = footage_.start_ns + *picture.container_ns;
    if (time < 0 || (!before.empty() && time <= before.back().timestamp_ns))
      throw Error(picture.name +
                  ": its container's times do not increase; give fps or "
                  "timestamps_ns");
    return time;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(file_.string() + ": " + footage_.source + " " + what);
  }

  const fs::path& file_;
  const FootageDescription& footage_;
  std::optional<Size> calibrated_, in_set_;
  session::SessionWriter& writer_;
  std::string first_;       // format and size of the first picture
  double farthest_ns_ = 0;  // of a frame's time from that in its container
};

template <typename Calibration>
std::optional<Size> size_of_pictures(const std::optional<Calibration>& calibration) {
  if (!calibration) return std::nullopt;
  return Size{calibration->intrinsics.width, calibration->intrinsics.height};
}

// Returns how many of the poses belong to a frame of the take.
std::uint64_t write_track(const ImportDescription& description, const fs::path& file,
                          const Imported& imported, session::SessionWriter& writer,
                          std::vector<std::string>& notes) {
  if (description.track.empty()) return 0;
  if (const auto last = description.track.back().frame; last >= imported.in_footage)
    throw Error(file.string() + ": track has a pose for frame " + std::to_string(last) +
                "; observer has frames 0 to " + std::to_string(imported.in_footage - 1));
  const std::vector<ImportedFrame>& frames = imported.frames;
  std::uint64_t poses = 0;
  auto pose = description.track.begin();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    session::TrackRecord record;
    while (pose != description.track.end() && pose->frame < frames[i].number) ++pose;
    if (pose != description.track.end() && pose->frame == frames[i].number) {
      record = *pose;
      ++poses;
    }
    record.frame = i;
    record.timestamp_ns = frames[i].timestamp_ns;
    writer.write(record);
  }
  if (const std::size_t unused = description.track.size() - poses)
    notes.push_back(file.string() + ": " + std::to_string(unused) +
                    (unused == 1 ? " pose belongs to a lost frame and is skipped"
                                 : " poses belong to lost frames and are skipped") +
                    "; lost and missing frames count");
  return poses;
}

// Says what does not hold of the tags in these frames (tracking/pose_judgement.hpp).
void judge_tracking(const ImportDescription& description, const std::vector<FramePtr>& frames,
                    std::vector<std::string>& notes) {
  if (!description.set || frames.empty()) return;
  const set::Set& set = *description.set;
  const std::optional<ObserverCalibration>& calibration =
      set.observer.calibration ? set.observer.calibration : description.observer_calibration;
  const Frame& first = *frames.front();
  if (!calibration || !set.tracking.enabled || set.tracking.tags.empty() ||
      calibration->intrinsics.width != first.width ||
      calibration->intrinsics.height != first.height)
    return;
  const auto tracker = tracking::make_tracker(set, *calibration, nullptr);
  tracking::PoseJudgement judgement(set.tracking, *calibration);
  for (const FramePtr& frame : frames) judgement.add(frame, tracker->track(*frame));
  for (const std::string& doubt : judgement.doubts()) notes.push_back("tracking: " + doubt);
}

session::SessionInfo info_of(const ImportDescription& description, const fs::path& target) {
  session::SessionInfo info;
  info.name = description.name.empty() ? target.filename().string() : description.name;
  info.clock = description.clock;
  info.observer = description.observer_calibration;
  info.light = description.light_calibration;
  if (description.set) {
    info.set_name = description.set->file.filename().string();
    info.set_text = set::read_set_file(description.set->file);
  }
  return info;
}

}  // namespace

ImportReport import_session(const ImportOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const ImportDescription description = read_description(options.description);
  const auto assets = description.set ? scene::assets_of(*description.set)
                                      : std::vector<std::pair<std::string, fs::path>>{};
  const set::Set in_set = description.set.value_or(set::Set{});
  ImportReport report;
  const fs::path target = without_slash(fs::absolute(options.session));
  check_target(target);
  session::remove_dead_drafts(target.parent_path());
  session::DraftFolder draft(target);
  {
    session::SessionWriter writer(draft.path(), info_of(description, target));
    for (const auto& [as_written, file] : assets) writer.add_asset(as_written, file);
    if (description.light)
      report.light_frames = FootageImport(options.description, *description.light,
                                          size_of_pictures(description.light_calibration),
                                          size_of_pictures(in_set.light_camera.calibration), writer)
                                .run(report.notes)
                                .frames.size();
    const Imported observer = FootageImport(options.description, description.observer,
                                            size_of_pictures(description.observer_calibration),
                                            size_of_pictures(in_set.observer.calibration), writer)
                                  .run(report.notes);
    report.observer_frames = observer.frames.size();
    if (observer.timecode) writer.set_timecode(*observer.timecode);
    report.poses = write_track(description, options.description, observer, writer, report.notes);
    writer.close();
    judge_tracking(description, observer.to_judge, report.notes);
  }
  report.assets = std::set<std::pair<std::string, fs::path>>(assets.begin(), assets.end()).size();
  report.bytes = size_of(draft.path());
  draft.put();
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return report;
}

}  // namespace previz::exchange
