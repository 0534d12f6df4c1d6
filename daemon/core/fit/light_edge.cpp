#include "daemon/core/fit/light_edge.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "drivers/calibration/pinhole.hpp"

namespace previz::fit {
namespace {

constexpr double longest_px = 40;
// An edge is found in a wrong place where the areas beside it are not plain: the largest residual
// of a fit, rms over the contrast.
constexpr double most_noise = 0.1;

}  // namespace

std::vector<Share> cut(double length_px, double margin_px) {
  const double inner = length_px - 2 * margin_px;
  if (!(inner >= shortest_px)) return {};
  const int count = static_cast<int>(std::ceil(inner / longest_px));
  const double margin = margin_px / length_px, each = (1 - 2 * margin) / count;
  std::vector<Share> pieces;
  for (int i = 0; i < count; ++i) pieces.push_back({margin + i * each, margin + (i + 1) * each});
  return pieces;
}

std::optional<glm::dvec2> on_pinhole(const PinholeIntrinsics& lens, const glm::dvec3& p) {
  if (!(p.z > 0)) return {};
  return glm::dvec2(lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy);
}

std::optional<glm::dvec2> pixel_of(const PinholeIntrinsics& lens, const glm::dvec2& on_pinhole) {
  const glm::dvec2 normalised =
      (on_pinhole - glm::dvec2(lens.cx, lens.cy)) / glm::dvec2(lens.fx, lens.fy);
  const glm::dvec2 px = distort(lens, normalised);
  const bool is_inside = px.x > depth_px && px.y > depth_px && px.x < lens.width - 1 - depth_px &&
                         px.y < lens.height - 1 - depth_px;
  if (!is_inside || !is_unfolded(lens, normalised, px)) return {};
  return px;
}

std::optional<tracking::EdgeFit> find_light(const tracking::Luminance& luminance,
                                            const PinholeIntrinsics& lens, const glm::dvec2& a,
                                            const glm::dvec2& b) {
  const glm::dvec2 along = glm::normalize(b - a), across(-along.y, along.x);
  std::optional<tracking::EdgeFit> best;
  for (const double side : {-1.0, 1.0}) {
    const tracking::EdgeGuess guess{a, b, a + side * depth_px * across, depth_px, depth_px};
    const char* why = nullptr;
    const auto fit = tracking::fit_edge(luminance, lens, guess, &why);
    if (fit && (!best || fit->noise / fit->contrast < best->noise / best->contrast)) best = fit;
  }
  if (best && best->noise > most_noise * best->contrast) return {};
  return best;
}

}  // namespace previz::fit
