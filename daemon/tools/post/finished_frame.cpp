#include "daemon/tools/post/finished_frame.hpp"

#include <glm/mat4x4.hpp>
#include <nlohmann/json.hpp>

#include "daemon/core/session/json_numbers.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

using session::number_at, session::number_or, session::numbers_of;

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

}  // namespace

std::int64_t samples_of(const pipeline::Shot& shot) {
  return shot.sums ? shot.sums->samples : shot.layers->samples;
}

FinishedFrame finished_frame(const pipeline::Shot& shot) {
  FinishedFrame frame;
  frame.frame = shot.index;
  frame.timestamp_ns = shot.frame->timestamp_ns;
  frame.status = shot.untouched.empty() ? FrameStatus::rendered : FrameStatus::untouched;
  frame.reason = shot.untouched;
  frame.samples = samples_of(shot);
  frame.render_s = shot.render_s;
  frame.error = shot.error;
  frame.pose = shot.track.pose;
  if (shot.light) {
    frame.light_frames = shot.light->sequences;
    frame.light_sources = shot.light->lighting.sources;
    frame.light_dropped_share = shot.light->lighting.report.dropped_share;
  }
  frame.counters = shot.counters;
  return frame;
}

std::string to_json(const FinishedFrame& frame) {
  nlohmann::ordered_json json;
  json["frame"] = frame.frame;
  json["timestamp_ns"] = frame.timestamp_ns;
  json["status"] = frame.status == FrameStatus::rendered ? "rendered" : "untouched";
  if (!frame.reason.empty()) json["reason"] = frame.reason;
  json["samples"] = frame.samples;
  json["render_s"] = frame.render_s;
  if (frame.peak_memory_bytes > 0) json["peak_memory_bytes"] = frame.peak_memory_bytes;
  if (frame.error > 0) json["error"] = frame.error;
  if (frame.pose) {
    json["world_from_camera"] = rows(frame.pose->world_from_camera);
    json["covariance"] = frame.pose->covariance;
    json["reprojection_rms_px"] = frame.pose->reprojection_rms_px;
    json["tags"] = frame.pose->tags;
  }
  json["light_frames"] = frame.light_frames;
  for (const lighting::Source& source : frame.light_sources)
    json["light_sources"].push_back({{"id", source.id},
                                     {"direction", numbers(source.direction)},
                                     {"solid_angle_sr", source.solid_angle_sr},
                                     {"flux", numbers(source.flux)}});
  if (frame.light_dropped_share > 0) json["light_dropped_share"] = frame.light_dropped_share;
  json["rays"] = frame.counters.rays;
  json["shadow_rays"] = frame.counters.shadow_rays;
  json["dropped_not_finite"] = frame.counters.dropped_not_finite;
  json["dropped_negative"] = frame.counters.dropped_negative;
  json["stopped_in_layers"] = frame.counters.stopped_in_layers;
  if (frame.counters.unfinished > 0) json["unfinished"] = frame.counters.unfinished;
  if (frame.counters.below_zero > 0) json["below_zero"] = frame.counters.below_zero;
  if (frame.counters.rebuilt_trees > 0) json["rebuilt_trees"] = frame.counters.rebuilt_trees;
  if (frame.counters.measured + frame.counters.unmeasured > 0) {
    json["measured"] = frame.counters.measured;
    json["unmeasured"] = frame.counters.unmeasured;
  }
  if (!frame.made_on.device.empty())
    json["device"] = {{"name", frame.made_on.device}, {"is_gpu", frame.made_on.is_gpu}};
  for (const auto& [name, mark] : frame.files)
    json["files"][name] = {{"bytes", mark.bytes}, {"sha256", mark.sha256}};
  return json.dump();
}

FinishedFrame from_json(const std::string& line) {
  const nlohmann::json json = nlohmann::json::parse(line);
  FinishedFrame frame;
  frame.frame = number_at<std::uint64_t>(json, "frame");
  frame.timestamp_ns = number_at<std::int64_t>(json, "timestamp_ns");
  frame.status = json.at("status") == "rendered" ? FrameStatus::rendered : FrameStatus::untouched;
  frame.reason = json.value("reason", "");
  frame.samples = number_at<std::int64_t>(json, "samples");
  frame.render_s = number_at<double>(json, "render_s");
  frame.peak_memory_bytes = number_or(json, "peak_memory_bytes", std::uint64_t{0});
  frame.error = number_or(json, "error", 0.0);
  if (json.contains("world_from_camera")) {
    frame.pose.emplace();
    frame.pose->world_from_camera = matrix_of(json["world_from_camera"]);
    frame.pose->covariance = json.at("covariance");
    frame.pose->reprojection_rms_px = json.at("reprojection_rms_px");
    frame.pose->tags = numbers_of<int>(json.at("tags"));
  }
  frame.light_frames = numbers_of<std::uint64_t>(json.at("light_frames"));
  if (json.contains("light_sources"))
    for (const nlohmann::json& source : json["light_sources"])
      frame.light_sources.push_back(
          {number_at<int>(source, "id"), vector_of(source.at("direction")),
           number_at<double>(source, "solid_angle_sr"), vector_of(source.at("flux"))});
  frame.light_dropped_share = number_or(json, "light_dropped_share", 0.0);
  frame.counters.rays = number_at<std::uint64_t>(json, "rays");
  frame.counters.shadow_rays = number_at<std::uint64_t>(json, "shadow_rays");
  frame.counters.dropped_not_finite = number_at<std::uint64_t>(json, "dropped_not_finite");
  frame.counters.dropped_negative = number_at<std::uint64_t>(json, "dropped_negative");
  frame.counters.stopped_in_layers = number_or(json, "stopped_in_layers", std::uint64_t{0});
  frame.counters.unfinished = number_or(json, "unfinished", std::uint64_t{0});
  frame.counters.below_zero = number_or(json, "below_zero", std::uint64_t{0});
  frame.counters.rebuilt_trees = number_or(json, "rebuilt_trees", std::uint64_t{0});
  frame.counters.measured = number_or(json, "measured", std::uint64_t{0});
  frame.counters.unmeasured = number_or(json, "unmeasured", std::uint64_t{0});
  if (json.contains("device"))
    frame.made_on = {json["device"].at("name"), json["device"].at("is_gpu")};
  if (json.contains("files"))
    for (const auto& [name, mark] : json["files"].items())
      frame.files[name] = {number_at<std::uint64_t>(mark, "bytes"), mark.at("sha256")};
  return frame;
}

std::string frames_words(const std::vector<std::uint64_t>& frames) {
  std::string text;
  for (std::size_t first = 0, last = 0; first < frames.size(); first = last = last + 1) {
    while (last + 1 < frames.size() && frames[last + 1] == frames[last] + 1) ++last;
    add_to_list(text, std::to_string(frames[first]) +
                          (last > first ? " to " + std::to_string(frames[last]) : ""));
  }
  return (frames.size() == 1 ? "frame " : "frames ") + text;
}

}  // namespace previz::post
