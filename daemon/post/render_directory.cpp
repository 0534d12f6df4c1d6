#include "daemon/post/render_directory.hpp"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
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

}  // namespace

RenderDirectory::RenderDirectory(const set::Output& output, const std::string& settings, bool force,
                                 const session::TakeClock& clock)
    : output_(output), clock_(clock) {
  std::error_code code;
  std::filesystem::create_directories(path(), code);
  if (!std::filesystem::is_directory(path()))
    throw Error(path().string() + ": cannot be made: " + code.message());
  if (!force) read_finished();
  if (!finished_.empty()) check_settings(settings);
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

std::filesystem::path RenderDirectory::file(std::uint64_t frame, const char* extension) const {
  std::string number = std::to_string(frame);
  number.insert(0, number.size() < 4 ? 4 - number.size() : 0, '0');
  return path() / (number + extension);
}

const FinishedFrame* RenderDirectory::finished(std::uint64_t frame) const {
  const auto found = finished_.find(frame);
  const bool whole = found != finished_.end() &&
                     (!output_.exr || std::filesystem::exists(file(frame, ".exr"))) &&
                     (!wants_png() || std::filesystem::exists(file(frame, ".png")));
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

  const FinishedFrame record = finished_frame(shot);
  std::ofstream lines(path() / lines_name, std::ios::app);
  lines << to_json(record) << std::endl;
  if (!lines) throw Error((path() / lines_name).string() + ": cannot be written");
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
