#include "daemon/post/render_directory.hpp"

#include <fcntl.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <set>
#include <utility>

#include "daemon/output/exr.hpp"
#include "daemon/output/png.hpp"
#include "daemon/output/video.hpp"
#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::post {
namespace {

constexpr const char* settings_name = "render.json";
constexpr const char* lines_name = "frames.jsonl";

// Returns the first few settings that differ: "quality.samples is 16 there and 64 now".
std::string differences(const nlohmann::json& there, const nlohmann::json& now) {
  std::string text;
  for (const auto& [key, value] : now.items()) {
    if (there.contains(key) && there[key] == value) continue;
    if (!text.empty()) text += "; ";
    const std::string before = there.contains(key) ? there[key].dump() : "unknown";
    const std::string after = value.dump();
    text += key;
    if (std::max(before.size(), after.size()) < 60)
      text += " is " + before + " there and " + after + " now";
    else
      text += " differs";
  }
  return text;
}

FileMark mark_of(const std::filesystem::path& file) {
  return {std::filesystem::file_size(file), session::sha256_of(file)};
}

// Decodes the whole picture; throws previz::Error if it is damaged.
void decode(const std::filesystem::path& file) {
  if (file.extension() == ".exr")
    output::read_exr(file);
  else
    output::read_png(file);
}

// Returns why a file of a finished frame cannot be kept, or an empty text. A line without any marks
// gets one for the file.
std::string why_broken(const std::filesystem::path& file, bool has_marks, FinishedFrame& record) {
  const std::string its = "its " + file.extension().string();
  std::error_code unknown;
  if (!std::filesystem::exists(file, unknown)) return its + " is missing";
  const std::string name = file.filename().string();
  try {
    if (!has_marks) {
      decode(file);
      record.files[name] = mark_of(file);
      return {};
    }
    const auto mark = record.files.find(name);
    if (mark == record.files.end()) return its + " is not in its line of frames.jsonl";
    if (std::filesystem::file_size(file, unknown) != mark->second.bytes)
      return its + " has another size than when it was written";
    if (session::sha256_of(file) != mark->second.sha256)
      return its + " has another content (SHA-256) than when it was written";
  } catch (const Error&) {
    return its + (has_marks ? " cannot be read" : " cannot be decoded");
  }
  return {};
}

// Returns the frame whose picture a file of this name is, if it is one: "0007.exr".
std::optional<std::uint64_t> frame_of(const std::filesystem::path& name) {
  const std::string digits = name.stem().string();
  std::uint64_t frame = 0;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), frame);
  if (code != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return frame;
}

}  // namespace

RenderDirectory::RenderDirectory(const set::Output& output, const std::string& settings, bool force,
                                 const session::TakeClock& clock, FrameRange range,
                                 const std::stop_token& stop)
    : output_(output), clock_(clock) {
  std::error_code code;
  std::filesystem::create_directories(path(), code);
  if (!std::filesystem::is_directory(path()))
    throw Error(path().string() + ": cannot be made: " + code.message());
  if (!force) read_finished();
  if (!finished_.empty()) check_settings(settings);
  if (!force) {
    reject_without_line(range);
    reject_broken(range, stop);
  }
  session::replace_file(path() / settings_name, settings);
  std::string lines;
  for (const auto& [frame, record] : finished_) lines += to_json(record) + "\n";
  session::replace_file(path() / lines_name, lines);
}

void RenderDirectory::check_settings(const std::string& settings) const {
  const std::filesystem::path name = path() / settings_name;
  std::ifstream file(name);
  const auto there = nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  const std::string differ =
      there.is_object() ? differences(there, nlohmann::json::parse(settings)) : "it cannot be read";
  if (!differ.empty())
    throw Error(name.string() + ": the frames there were rendered with other settings (" + differ +
                "); name another directory with --out, or render them again with --force");
}

void RenderDirectory::read_finished() {
  std::ifstream file(path() / lines_name);
  for (std::string line; std::getline(file, line);) {
    try {
      const FinishedFrame record = from_json(line);
      finished_[record.frame] = record;
    } catch (const nlohmann::json::exception&) {
      // A power cut may leave a line half written; its frame is rendered again.
    }
  }
}

void RenderDirectory::reject_without_line(FrameRange range) {
  std::set<std::uint64_t> frames;
  for (const auto& entry : std::filesystem::directory_iterator(path())) {
    const std::optional<std::uint64_t> frame = frame_of(entry.path().filename());
    if (!frame || *frame < range.first || *frame > range.last || finished_.contains(*frame))
      continue;
    for (const char* extension : extensions())
      if (file(*frame, extension).filename() == entry.path().filename()) frames.insert(*frame);
  }
  if (!frames.empty())
    rejected_["it has no whole line in " + std::string(lines_name)].assign(frames.begin(),
                                                                           frames.end());
}

void RenderDirectory::reject_broken(FrameRange range, const std::stop_token& stop) {
  for (auto at = finished_.lower_bound(range.first);
       at != finished_.end() && at->first <= range.last;) {
    if (stop.stop_requested())
      throw Error(path().string() +
                  ": interrupted while the finished frames were checked; nothing was changed, the "
                  "same command starts again");
    auto& [frame, record] = *at;
    const bool has_marks = !record.files.empty();
    std::string why;
    for (const char* extension : extensions())
      if (why.empty()) why = why_broken(file(frame, extension), has_marks, record);
    if (!why.empty()) rejected_[why].push_back(frame);
    at = why.empty() ? std::next(at) : finished_.erase(at);
  }
}

std::vector<const char*> RenderDirectory::extensions() const {
  std::vector<const char*> all;
  if (output_.exr) all.push_back(".exr");
  if (wants_png()) all.push_back(".png");
  return all;
}

std::filesystem::path RenderDirectory::file(std::uint64_t frame, const char* extension) const {
  std::string number = std::to_string(frame);
  number.insert(0, number.size() < 4 ? 4 - number.size() : 0, '0');
  return path() / (number + extension);
}

const FinishedFrame* RenderDirectory::finished(std::uint64_t frame) const {
  const auto found = finished_.find(frame);
  const bool whole =
      found != finished_.end() && std::ranges::all_of(extensions(), [&](const char* extension) {
        return std::filesystem::exists(file(frame, extension));
      });
  return whole ? &found->second : nullptr;
}

void RenderDirectory::write(const pipeline::Shot& shot, const set::Set& set) {
  if (output_.exr) {
    output::ExrMetadata metadata = output::exr_metadata(*shot.layers, *shot.frame, shot.track, set);
    metadata.fps = clock_.fps;
    metadata.timecode = clock_.at(shot.frame->timestamp_ns);
    output::write_exr(file(shot.index, ".exr"), *shot.layers, metadata);
  }
  if (wants_png()) output::write_png(file(shot.index, ".png"), *shot.picture);

  FinishedFrame record = finished_frame(shot);
  for (const char* extension : extensions()) {
    const std::filesystem::path written = file(shot.index, extension);
    record.files[written.filename().string()] = mark_of(written);
  }
  const session::OpenFile lines(path() / lines_name, O_WRONLY | O_CREAT | O_APPEND);
  lines.append(to_json(record) + "\n");
  lines.sync();
  finished_[record.frame] = record;
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
  out << written.string() << ": " << frames.size() << " pictures, " << codecs.front().description
      << std::endl;
  if (clock_.timecode && !session::counts_frames(clock_))
    out << "  without timecode: the take's counts " << clock_.timecode->fps
        << " frames a second (recording.timecode_fps), and it has " << clock_.fps << std::endl;
  return written;
}

}  // namespace previz::post
