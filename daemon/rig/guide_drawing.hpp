// Collects lines and words of the world over one picture.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/fit/visible_edges.hpp"
#include "daemon/core/output/guide_page.hpp"
#include "drivers/calibration.hpp"

namespace previz::rig {

class GuideDrawing {
 public:
  // Both must outlive this.
  GuideDrawing(const PinholeIntrinsics& lens, const glm::dmat4& world_from_camera);

  void add(const std::vector<fit::Segment>& segments, output::GuideKind kind);
  // Draws what of a line, or of a word's place, is in the picture.
  void line(const glm::dvec3& a, const glm::dvec3& b, output::GuideKind kind);
  void word(const glm::dvec3& at, std::string text, output::GuideKind kind);

  output::GuidePage page() && { return std::move(page_); }

 protected:
  glm::dvec3 eye() const { return world_from_camera_[3]; }
  const PinholeIntrinsics& lens() const { return lens_; }
  output::GuidePage& drawn() { return page_; }

 private:
  const PinholeIntrinsics& lens_;
  const glm::dmat4& world_from_camera_;
  output::GuidePage page_;
};

}  // namespace previz::rig
