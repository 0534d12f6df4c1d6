#include "daemon/post/render_directory.hpp"

#include <algorithm>
#include <fstream>
#include <glm/mat4x4.hpp>
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

nlohmann::ordered_json rows(const glm::dmat4& matrix) {
  nlohmann::ordered_json result;
  for (int row = 0; row < 4; ++row)
    result.push_back({matrix[0][row], matrix[1][row], matrix[2][row], matrix[3][row]});
  return result;
}

glm::dmat4 matrix_of(const nlohmann::json& rows) {
  glm::dmat4 matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) matrix[column][row] = rows.at(row).at(column);
  return matrix;
}

nlohmann::ordered_json numbers(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

glm::dvec3 vector_of(const nlohmann::json& json) {
  return {json.at(0), json.at(1), json.at(2)};
}

// "quality.samples is 16 there and 64 now": the first few settings that differ.
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

FrameRecord record_of(const pipeline::Shot& shot) {
  FrameRecord record;
  record.frame = shot.index;
  record.timestamp_ns = shot.frame->timestamp_ns;
  record.status = shot.untouched.empty() ? FrameStatus::rendered : FrameStatus::untouched;
  record.reason = shot.untouched;
  record.samples = shot.layers.samples;
  record.render_s = shot.render_s;
  record.error = shot.error;
  record.pose = shot.track.pose;
  if (shot.light) {
    record.light_frames = shot.light->sequences;
    record.light_sources = shot.light->lighting.sources;
    record.light_dropped_share = shot.light->lighting.report.dropped_share;
  }
  record.counters = shot.counters;
  return record;
}

std::string to_json(const FrameRecord& record) {
  nlohmann::ordered_json json;
  json["frame"] = record.frame;
  json["timestamp_ns"] = record.timestamp_ns;
  json["status"] = record.status == FrameStatus::rendered ? "rendered" : "untouched";
  if (!record.reason.empty()) json["reason"] = record.reason;
  json["samples"] = record.samples;
  json["render_s"] = record.render_s;
  if (record.error > 0) json["error"] = record.error;
  if (record.pose) {
    json["world_from_camera"] = rows(record.pose->world_from_camera);
    json["covariance"] = record.pose->covariance;
    json["reprojection_rms_px"] = record.pose->reprojection_rms_px;
    json["tags"] = record.pose->tags;
  }
  json["light_frames"] = record.light_frames;
  for (const lighting::Source& source : record.light_sources)
    json["light_sources"].push_back({{"id", source.id},
                                     {"direction", numbers(source.direction)},
                                     {"solid_angle_sr", source.solid_angle_sr},
                                     {"flux", numbers(source.flux)}});
  if (record.light_dropped_share > 0) json["light_dropped_share"] = record.light_dropped_share;
  json["rays"] = record.counters.rays;
  json["shadow_rays"] = record.counters.shadow_rays;
  json["dropped_not_finite"] = record.counters.dropped_not_finite;
  json["dropped_negative"] = record.counters.dropped_negative;
  json["stopped_in_layers"] = record.counters.stopped_in_layers;
  if (record.counters.measured + record.counters.unmeasured > 0) {
    json["measured"] = record.counters.measured;
    json["unmeasured"] = record.counters.unmeasured;
  }
  return json.dump();
}

FrameRecord from_json(const std::string& line) {
  const nlohmann::json json = nlohmann::json::parse(line);
  FrameRecord record;
  record.frame = json.at("frame");
  record.timestamp_ns = json.at("timestamp_ns");
  record.status = json.at("status") == "rendered" ? FrameStatus::rendered : FrameStatus::untouched;
  record.reason = json.value("reason", "");
  record.samples = json.at("samples");
  record.render_s = json.at("render_s");
  record.error = json.value("error", 0.0);
  if (json.contains("world_from_camera")) {
    record.pose.emplace();
    record.pose->world_from_camera = matrix_of(json["world_from_camera"]);
    record.pose->covariance = json.at("covariance");
    record.pose->reprojection_rms_px = json.at("reprojection_rms_px");
    record.pose->tags = json.at("tags").get<std::vector<int>>();
  }
  record.light_frames = json.at("light_frames").get<std::vector<std::uint64_t>>();
  if (json.contains("light_sources"))
    for (const nlohmann::json& source : json["light_sources"])
      record.light_sources.push_back({source.at("id"), vector_of(source.at("direction")),
                                      source.at("solid_angle_sr"), vector_of(source.at("flux"))});
  record.light_dropped_share = json.value("light_dropped_share", 0.0);
  record.counters.rays = json.at("rays");
  record.counters.shadow_rays = json.at("shadow_rays");
  record.counters.dropped_not_finite = json.at("dropped_not_finite");
  record.counters.dropped_negative = json.at("dropped_negative");
  record.counters.stopped_in_layers = json.value("stopped_in_layers", std::uint64_t{0});
  record.counters.measured = json.value("measured", std::uint64_t{0});
  record.counters.unmeasured = json.value("unmeasured", std::uint64_t{0});
  return record;
}

RenderDirectory::RenderDirectory(const set::Output& output, const std::string& settings, bool force)
    : output_(output) {
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
      const FrameRecord record = from_json(line);
      finished_[record.frame] = record;
    } catch (const nlohmann::json::exception&) {
      // The line a power cut left half written: its frame is rendered again.
    }
  }
}

std::filesystem::path RenderDirectory::file(std::uint64_t frame, const char* extension) const {
  std::string number = std::to_string(frame);
  number.insert(0, number.size() < 4 ? 4 - number.size() : 0, '0');
  return path() / (number + extension);
}

const FrameRecord* RenderDirectory::finished(std::uint64_t frame) const {
  const auto found = finished_.find(frame);
  const bool whole = found != finished_.end() &&
                     (!output_.exr || std::filesystem::exists(file(frame, ".exr"))) &&
                     (!wants_png() || std::filesystem::exists(file(frame, ".png")));
  return whole ? &found->second : nullptr;
}

void RenderDirectory::write(const pipeline::Shot& shot, const set::Set& set) {
  if (output_.exr)
    output::write_exr(file(shot.index, ".exr"), shot.layers,
                      output::exr_metadata(shot.layers, *shot.frame, shot.track, set));
  if (wants_png()) output::write_png(file(shot.index, ".png"), shot.picture);

  const FrameRecord record = record_of(shot);
  std::ofstream lines(path() / lines_name, std::ios::app);
  lines << to_json(record) << std::endl;
  if (!lines) throw Error((path() / lines_name).string() + ": cannot be written");
  finished_[record.frame] = record;
}

std::filesystem::path RenderDirectory::write_video(const std::vector<FrameRecord>& frames,
                                                   std::ostream& out) const {
  const std::vector<output::VideoCodec> codecs = output::review_codecs();
  if (codecs.empty())
    throw Error(
        (path() / "review").string() +
        ": libav has none of the encoders libx264, mpeg4 and ffv1; set output.video = false");
  std::optional<output::VideoWriter> video;
  for (const FrameRecord& frame : frames) {
    const Plate picture = output::read_png(file(frame.frame, ".png"));
    if (!video) video.emplace(path() / "review", picture.width, picture.height, codecs.front());
    video->write(picture, frame.timestamp_ns);
  }
  std::filesystem::path written = video->close();
  out << written.string() << ": " << frames.size() << " pictures, " << codecs.front().description
      << std::endl;
  return written;
}

}  // namespace previz::post
