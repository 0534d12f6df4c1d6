#include "daemon/rig/guide_drawing.hpp"

#include <utility>

#include "daemon/core/fit/light_edge.hpp"
#include "daemon/core/tracking/camera_pose.hpp"

namespace previz::rig {

using output::GuideKind;

GuideDrawing::GuideDrawing(const PinholeIntrinsics& lens, const glm::dmat4& world_from_camera)
    : lens_(lens), world_from_camera_(world_from_camera) {
  page_.width = lens.width;
  page_.height = lens.height;
}

void GuideDrawing::add(const std::vector<fit::Segment>& segments, GuideKind kind) {
  for (const fit::Segment& segment : segments) page_.lines.push_back({segment.a, segment.b, kind});
}

void GuideDrawing::line(const glm::dvec3& a, const glm::dvec3& b, GuideKind kind) {
  add(fit::line_segments(a, b, lens_, world_from_camera_), kind);
}

void GuideDrawing::word(const glm::dvec3& at, std::string text, GuideKind kind) {
  const tracking::CameraFromWorld camera = tracking::camera_from_world(world_from_camera_);
  const auto pinhole = fit::on_pinhole(lens_, camera.rotation * at + camera.translation);
  const auto pixel = pinhole ? fit::pixel_of(lens_, *pinhole) : std::nullopt;
  if (pixel) page_.words.push_back({*pixel, std::move(text), kind});
}

}  // namespace previz::rig
