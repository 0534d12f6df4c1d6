#include "daemon/core/fit/figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>

#include "daemon/core/fit/light_edge.hpp"
#include "daemon/core/fit/visible_edges.hpp"
#include "daemon/core/tracking/photometry.hpp"

namespace previz::fit {
namespace {

// find_light() reaches about 2 px; lines so far apart are where it begins.
constexpr double between_lines_px = 3;
// Two findings that are as near as this are the same edge of light.
constexpr double same_px = 0.5;

std::vector<Light> look_near(const tracking::Luminance& luminance, const PinholeIntrinsics& lens,
                             const Segment& piece, const glm::dvec2& normal) {
  std::vector<Light> lights;
  const int lines = int(reach_px / between_lines_px);
  for (int i = -lines; i <= lines; ++i) {
    const glm::dvec2 shift = i * between_lines_px * normal;
    const auto fit = find_light(luminance, lens, piece.a + shift, piece.b + shift);
    if (!fit) continue;
    const double a = glm::dot(fit->a - piece.a, normal), b = glm::dot(fit->b - piece.b, normal);
    const Light light{0.5 * (a + b), 0.5 * (std::abs(a) + std::abs(b))};
    if (light.off_px <= reach_px && std::ranges::none_of(lights, [&](const Light& other) {
          return std::abs(other.along_normal_px - light.along_normal_px) < same_px;
        }))
      lights.push_back(light);
  }
  return lights;
}

// Returns how a point in a depth moves in the picture if it does in the world.
std::array<glm::dvec3, 2> px_per_m(const PinholeIntrinsics& lens,
                                   const glm::dmat4& world_from_camera, const glm::dvec2& px,
                                   double depth_m) {
  const glm::dvec3 right(world_from_camera[0]), down(world_from_camera[1]),
      ahead(world_from_camera[2]);
  return {(lens.fx * right - (px.x - lens.cx) * ahead) / depth_m,
          (lens.fy * down - (px.y - lens.cy) * ahead) / depth_m};
}

double percentile(std::vector<double> values, double share) {
  const auto nth = values.begin() + std::ptrdiff_t(std::llround(share * double(values.size() - 1)));
  std::ranges::nth_element(values, nth);
  return *nth;
}

}  // namespace

double off_px(const Figure& figure) {
  return figure.off ? std::max(figure.off->median_px, figure.off->shift_px) : 0;
}

void Measurement::look(const Frame& frame, const glm::dmat4& world_from_camera) {
  const PinholeIntrinsics& lens = camera_.intrinsics;
  if (frame.width != lens.width || frame.height != lens.height) {
    refused_ = fmt::format("the pictures have {}x{} pixels, and the lens is calibrated for {}x{}",
                           frame.width, frame.height, lens.width, lens.height);
    return;
  }
  const tracking::Photometry photometry(camera_.response);
  const auto luminance = [&](int x, int y) { return photometry.luminance(frame, x, y); };
  ++frames_;
  std::vector<EdgeSample> found;
  std::map<std::size_t, PartVotes> parts;
  for (const Segment& piece : measurable_pieces(model_, lens, world_from_camera)) {
    ++looked_at_;
    PartVotes& part = parts[piece.part];
    ++part.looked_at;
    const glm::dvec2 along = glm::normalize(piece.b - piece.a), normal(-along.y, along.x);
    EdgeSample sample{normal,
                      look_near(luminance, lens, piece, normal),
                      0.5 * (piece.a + piece.b),
                      piece.part,
                      {}};
    sample.px_per_m = px_per_m(lens, world_from_camera, sample.at, piece.depth_m);
    if (sample.lights.empty()) continue;
    part.votes.add(sample);
    found.push_back(std::move(sample));
  }
  Votes all;
  for (const auto& [number, part] : parts) all.add(part.votes);
  parts_.look(parts, all, found);
  const glm::dvec2 shift = all.best();
  for (const EdgeSample& sample : found) off_px_.push_back(nearest(sample, shift).off_px);
  if (!found.empty()) shift_px_.push_back(glm::length(shift));
}

Figure Measurement::figure() const {
  Figure figure{frames_, looked_at_, off_px_.size(), {}, refused_, {}, {}};
  if (!refused_.empty()) return figure;
  figure.things_off = parts_.off(model_.parts());
  figure.not_judged = parts_.not_judged(model_.parts());
  if (frames_ == 0)
    figure.why = "none of the pictures looked at has a pose";
  else if (looked_at_ < least_pieces)
    figure.why = "the pictures show too few straight edges of the model";
  else if (off_px_.size() < least_pieces)
    figure.why = "the pictures have edges of light at too few of the model's";
  else
    figure.off =
        Figure::Off{percentile(off_px_, 0.5), percentile(off_px_, 0.9), percentile(shift_px_, 0.5)};
  return figure;
}

}  // namespace previz::fit
