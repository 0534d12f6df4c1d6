#include "daemon/core/output/check.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string_view>

#include "daemon/core/output/recorder.hpp"
#include "daemon/core/output/take_folders.hpp"
#include "daemon/core/session/summary.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

namespace fs = std::filesystem;
using Lines = std::vector<std::string>;

constexpr double megabyte = 1e6, short_film_s = 600;

std::string size_in_words(double bytes) {
  if (bytes < 1e9) return fmt::format("{:.0f} MB", bytes / megabyte);
  return fmt::format("{:.3g} GB", bytes / 1e9);
}

std::string time_in_words(double seconds) {
  if (seconds < 120) return fmt::format("{:.0f} s", seconds);
  const auto minutes = static_cast<std::int64_t>(seconds / 60);
  if (minutes < 120) return fmt::format("{} minutes", minutes);
  return fmt::format("{} hours", minutes / 60);
}

double bytes_a_pixel(const std::string& format) {
  const auto has = [&](std::string_view part) { return format.find(part) != std::string::npos; };
  if (has("RGB") || has("BGR")) return 3;
  const bool one_sample = has("Bayer") || has("Mono") || has("GREY") || has("SRGGB");
  return one_sample && has("8") ? 1 : 2;
}

// Returns the frames a second of a session's camera; nothing if it has too few.
std::optional<double> recorded_rate(const fs::path& session, bool is_light) {
  try {
    const session::Summary summary = session::summary_of(session);
    const auto frames = static_cast<double>(is_light ? summary.light_frames : summary.frames);
    if (frames < 2 || summary.seconds <= 0) return std::nullopt;
    return (frames - 1) / summary.seconds;
  } catch (const Error&) {  // the cameras' part of the check says so
    return std::nullopt;
  }
}

struct PictureSize {
  int width, height;
};

template <class Calibration>
std::optional<PictureSize> size_of(const set::CameraWish& wish,
                                   const std::optional<Calibration>& calibration) {
  const CameraSettings& wished = wish.settings;
  if (wished.width && wished.height) return PictureSize{*wished.width, *wished.height};
  if (!calibration) return std::nullopt;
  return PictureSize{calibration->intrinsics.width, calibration->intrinsics.height};
}

template <class Camera>
void add(const Camera& camera, const char* table, bool is_light, ExpectedFrames& expected) {
  if (camera.driver == set::no_driver) return;
  const bool is_replayed = camera.driver == set::replay_driver;
  const auto rate =
      is_replayed ? recorded_rate(camera.device, is_light) : camera.camera.settings.rate_hz;
  const auto size = size_of(camera.camera, camera.calibration);
  if (!rate || !size) {
    if (!is_replayed) expected.unknown.emplace_back(table);
    return;
  }
  const double pixels = static_cast<double>(size->width) * size->height;
  expected.bytes_a_second +=
      pixels * *rate * bytes_a_pixel(camera.camera.settings.format.value_or(""));
}

struct Folder {
  const char* key;
  fs::path path;
};

std::vector<Folder> folders_of(const set::Recording& recording) {
  std::vector<Folder> folders = {{"recording.directory", recording.directory}};
  if (recording.second_directory)
    folders.push_back({"recording.second_directory", *recording.second_directory});
  return folders;
}

std::optional<double> free_bytes(const fs::path& folder) {
  try {
    return static_cast<double>(free_on_disk_of(folder, {}));
  } catch (const fs::filesystem_error&) {  // it is said of the folder itself
    return std::nullopt;
  }
}

// Returns for how long of the cameras' pictures a folder's disk has room; raw, which is the least.
std::optional<double> lasting_s(const set::Recording& recording, const fs::path& folder,
                                double bytes_a_second) {
  const std::optional<double> free = free_bytes(folder);
  if (!free || bytes_a_second <= 0) return std::nullopt;
  return std::max(0.0, *free - megabyte * recording.reserve_mb) / bytes_a_second;
}

void look_at_disk(const set::Recording& recording, const Folder& folder, double bytes_a_second,
                  Lines& lines) {
  const fs::path there = existing_part(folder.path);
  if (::access(there.c_str(), W_OK) != 0)
    lines.push_back(fmt::format(
        "{}: you may not write to {}; takes are written by the user who runs the rig: the "
        "service runs as previzd",
        folder.key, there.string()));
  const std::optional<double> free = free_bytes(folder.path);
  if (free && *free < megabyte * recording.reserve_mb)
    return lines.push_back(fmt::format(
        "{}: the disk is almost full: {} are left, and recording.reserve_mb keeps {} free; no take "
        "can begin there",
        folder.key, size_in_words(*free), size_in_words(megabyte * recording.reserve_mb)));
  const std::optional<double> lasts_s = lasting_s(recording, folder.path, bytes_a_second);
  if (lasts_s && *lasts_s < short_film_s)
    lines.push_back(fmt::format("{}: the disk may be full after {} of recording", folder.key,
                                time_in_words(*lasts_s)));
}

void look_at_preroll(const set::Recording& recording, double bytes_a_second,
                     std::uint64_t memory_bytes, Lines& lines) {
  const double queue = megabyte * recording.queue_mb.value_or(0);
  if (recording.queue_mb && queue > static_cast<double>(most_queue_bytes(memory_bytes)))
    lines.push_back(fmt::format(
        "recording.queue_mb = {:g}: this computer has {}; three quarters of it are used",
        *recording.queue_mb, size_in_words(static_cast<double>(memory_bytes))));
  const double room = 0.5 * static_cast<double>(queue_bytes(recording.queue_mb, memory_bytes));
  const double needed = recording.preroll_s * bytes_a_second;
  if (needed > room)
    lines.push_back(fmt::format(
        "recording.preroll_s = {:g}: this needs about {} of memory and there are {}, so that a "
        "take begins about {:.1f} s before the button; more by recording.queue_mb, of which it is "
        "half",
        recording.preroll_s, size_in_words(needed), size_in_words(room), room / bytes_a_second));
}

}  // namespace

ExpectedFrames expected_frames(const set::Set& set) {
  ExpectedFrames expected;
  add(set.observer, "[observer.camera]", false, expected);
  add(set.light_camera, "[light_camera.camera]", true, expected);
  return expected;
}

Lines why_nothing_is_recorded(const set::Set& set) {
  Lines lines;
  for (const Folder& folder : folders_of(set.recording)) {
    std::error_code unknown;
    const fs::path there = existing_part(folder.path);
    if (fs::exists(there, unknown) && !fs::is_directory(there, unknown))
      lines.push_back(
          fmt::format("{}: {}: {} is a file; allowed: a folder, which is created if it "
                      "is missing",
                      set.file.string(), folder.key, there.string()));
  }
  return lines;
}

Lines remarks_on_recording(const set::Set& set, std::uint64_t memory_bytes) {
  Lines lines;
  const set::Recording& recording = set.recording;
  const double bytes_a_second = expected_frames(set).bytes_a_second;
  for (const Folder& folder : folders_of(recording))
    look_at_disk(recording, folder, bytes_a_second, lines);
  if (recording.second_directory &&
      are_on_one_disk(recording.directory, *recording.second_directory))
    lines.emplace_back(
        "recording.second_directory is now on the same disk as recording.directory: if that is "
        "full or fails, recording stops");
  look_at_preroll(recording, bytes_a_second, memory_bytes, lines);
  return lines;
}

void check(const set::CheckedSet& checked, set::Findings& findings) {
  if (checked.is_take) return;
  std::ranges::copy(why_nothing_is_recorded(checked.set), std::back_inserter(findings.problems));
  std::ranges::copy(remarks_on_recording(checked.set, memory_bytes()),
                    std::back_inserter(findings.remarks));
}

void describe(const set::Set& set, std::ostream& out) {
  const set::Recording& recording = set.recording;
  const ExpectedFrames expected = expected_frames(set);
  out << "\nrecording\n";
  if (expected.bytes_a_second > 0)
    out << fmt::format("  the cameras' pictures: about {} per second, {}\n",
                       size_in_words(expected.bytes_a_second),
                       recording.codec == session::VideoCodec::raw
                           ? "recorded as they are (raw)"
                           : "and about half of that recorded (ffv1)");
  for (const std::string& table : expected.unknown)
    out << "  for how long the disk lasts cannot be said without " << table
        << " rate_hz and the picture's size\n";
  for (const Folder& folder : folders_of(recording)) {
    out << "  takes go to " << folder.path.string();
    if (const auto free = free_bytes(folder.path))
      out << fmt::format(", {} free", size_in_words(*free));
    if (const auto lasts_s = lasting_s(recording, folder.path, expected.bytes_a_second))
      out << ", enough for at least " << time_in_words(*lasts_s);
    out << '\n';
  }
}

}  // namespace previz::output
