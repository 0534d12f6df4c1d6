#include "daemon/tools/calibrate/lens/fisheye_tags.hpp"

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <numbers>

#include "daemon/core/tracking/photometry.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "drivers/calibration/pinhole.hpp"

namespace previz::calibrate {
namespace {

constexpr double half_view = std::numbers::pi / 4;
constexpr double off_axis = std::numbers::pi / 3;
constexpr int views_around = 6;

// The linear luminance of a frame, computed once.
struct LuminancePicture {
  int width = 0, height = 0;
  std::vector<float> values;

  LuminancePicture(const Frame& frame, const ResponseCurve& response)
      : width(frame.width), height(frame.height) {
    const tracking::Photometry photometry(response);
    values.reserve(std::size_t(width) * std::size_t(height));
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) values.push_back(float(photometry.luminance(frame, x, y)));
  }

  // Interpolates bilinearly; 0 outside the picture.
  double at(const glm::dvec2& p) const {
    const int x = int(std::floor(p.x)), y = int(std::floor(p.y));
    if (x < 0 || y < 0 || x + 1 >= width || y + 1 >= height) return 0;
    const float* v = &values[std::size_t(y) * std::size_t(width) + std::size_t(x)];
    const double s = p.x - x, t = p.y - y;
    return (1 - t) * ((1 - s) * v[0] + s * v[1]) + t * ((1 - s) * v[width] + s * v[width + 1]);
  }
};

PinholeIntrinsics view_lens(double focal_px) {
  const int side = int(2 * focal_px * std::tan(half_view));
  PinholeIntrinsics lens;
  lens.width = lens.height = side;
  lens.fx = lens.fy = focal_px;
  lens.cx = lens.cy = 0.5 * (side - 1);
  return lens;
}

glm::dvec3 ray_of(const PinholeIntrinsics& lens, const glm::dvec2& pixel) {
  return {(pixel.x - lens.cx) / lens.fx, (pixel.y - lens.cy) / lens.fy, 1};
}

// Returns a linear 16-bit picture of what the pinhole camera sees.
Frame resampled(const LuminancePicture& picture, const Fisheye& fisheye,
                const PinholeIntrinsics& lens, const glm::dmat3& fisheye_from_view) {
  Frame frame;
  frame.format = PixelFormat::gray16;
  frame.width = lens.width;
  frame.height = lens.height;
  frame.bytes.resize(frame_bytes(frame.format, frame.width, frame.height));
  for (int y = 0; y < lens.height; ++y)
    for (int x = 0; x < lens.width; ++x) {
      const auto pixel = fisheye.project(fisheye_from_view * ray_of(lens, {x, y}));
      const double signal = pixel ? picture.at(*pixel) : 0;
      const auto sample = std::uint16_t(std::lround(65535 * std::min(signal, 1.0)));
      std::memcpy(&frame.bytes[2 * std::size_t(y * lens.width + x)], &sample, 2);
    }
  return frame;
}

std::vector<glm::dmat3> view_rotations() {
  std::vector<glm::dmat3> rotations{glm::dmat3(1.0)};
  for (int i = 0; i < views_around; ++i) {
    const double around = 2 * std::numbers::pi * i / views_around;
    rotations.push_back(glm::mat3_cast(
        glm::angleAxis(off_axis, glm::dvec3(std::cos(around), std::sin(around), 0))));
  }
  return rotations;
}

struct Candidate {
  tracking::TagDetection tag;
  double from_middle = HUGE_VAL;  // tangent of the angle to the view's axis
};

double from_middle(const tracking::TagDetection& tag, const PinholeIntrinsics& lens) {
  const glm::dvec2 centre =
      0.25 * (tag.corners[0] + tag.corners[1] + tag.corners[2] + tag.corners[3]);
  return glm::length(glm::dvec2(ray_of(lens, centre)));
}

}  // namespace

std::vector<tracking::TagDetection> detect_in_fisheye(const Frame& frame,
                                                      const FisheyeIntrinsics& intrinsics,
                                                      const ResponseCurve& response,
                                                      const tracking::DetectorSettings& settings) {
  const Fisheye fisheye(intrinsics);
  const LuminancePicture picture(frame, response);
  const PinholeIntrinsics lens = view_lens(std::max(intrinsics.fx, intrinsics.fy));
  ResponseCurve linear;
  linear.kind = ResponseCurve::Kind::linear;
  tracking::TagDetector detector(settings, lens, linear);
  std::map<int, Candidate> best;
  for (const glm::dmat3& fisheye_from_view : view_rotations()) {
    const Frame view = resampled(picture, fisheye, lens, fisheye_from_view);
    for (tracking::TagDetection& tag : detector.detect(view, 1)) {
      const double distance = from_middle(tag, lens);
      const bool is_measured = tag.refined || !settings.are_edges_fitted;
      if (!tag.trouble.empty() || !is_measured || distance >= best[tag.id].from_middle) continue;
      bool all_seen = true;
      for (glm::dvec2& corner : tag.corners) {
        const auto pixel = fisheye.project(fisheye_from_view * ray_of(lens, corner));
        all_seen = all_seen && pixel;
        if (pixel) corner = *pixel;
      }
      if (all_seen) best[tag.id] = {tag, distance};
    }
  }
  std::vector<tracking::TagDetection> tags;
  for (auto& [id, candidate] : best)
    if (candidate.from_middle < HUGE_VAL) tags.push_back(std::move(candidate.tag));
  return tags;
}

}  // namespace previz::calibrate
