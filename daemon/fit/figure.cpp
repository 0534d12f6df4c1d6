#include "daemon/fit/figure.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "daemon/fit/light_edge.hpp"
#include "daemon/fit/visible_edges.hpp"
#include "daemon/tracking/photometry.hpp"

namespace previz::fit {
namespace {

// find_light() reaches about 2 px; lines so far apart are where it begins.
constexpr double between_lines_px = 3;
// Two findings that are as near as this are the same edge of light.
constexpr double same_px = 0.5;
// Edges agree on how far the model is off within this.
constexpr double agree_px = 1;
constexpr double shift_step_px = 0.5;
// A shift that is a pixel longer must convince so many more of the pieces.
constexpr double share_a_px = 0.005;

// An edge of light near a piece of an edge of the model.
struct Light {
  double along_normal_px = 0;  // of its middle, from the piece's
  double off_px = 0;           // of its ends, >= 0, in the mean
};

struct Looked {
  glm::dvec2 normal{0};
  std::vector<Light> lights;  // not empty
};

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

// Returns the edge of light that is nearest to where the piece is after a shift.
const Light& nearest(const Looked& looked, const glm::dvec2& shift) {
  const double at = glm::dot(looked.normal, shift);
  return *std::ranges::min_element(
      looked.lights, {}, [&](const Light& light) { return std::abs(light.along_normal_px - at); });
}

double agreement(const Looked& looked, const glm::dvec2& shift) {
  const double off = nearest(looked, shift).along_normal_px - glm::dot(looked.normal, shift);
  return std::max(0.0, 1 - off * off / (agree_px * agree_px));
}

// Returns the shift of the model, px, on which most pieces agree. A picture has edges of light that
// are not the model's, and each piece alone would take the nearest: of a model that is off, that
// is mostly another's.
glm::dvec2 common_shift(const std::vector<Looked>& pieces) {
  glm::dvec2 best(0);
  double most = -1;
  const int steps = int(reach_px / shift_step_px);
  for (int y = -steps; y <= steps; ++y)
    for (int x = -steps; x <= steps; ++x) {
      const glm::dvec2 shift = shift_step_px * glm::dvec2(x, y);
      double sum = -share_a_px * double(pieces.size()) * glm::length(shift);
      for (const Looked& looked : pieces) sum += agreement(looked, shift);
      if (sum > most) most = sum, best = shift;
    }
  return best;
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
  const tracking::Photometry photometry(camera_.response);
  const auto luminance = [&](int x, int y) { return photometry.luminance(frame, x, y); };
  ++frames_;
  std::vector<Looked> found;
  for (const Segment& piece : measurable_pieces(model_, camera_.intrinsics, world_from_camera)) {
    ++looked_at_;
    const glm::dvec2 along = glm::normalize(piece.b - piece.a), normal(-along.y, along.x);
    Looked looked{normal, look_near(luminance, camera_.intrinsics, piece, normal)};
    if (!looked.lights.empty()) found.push_back(std::move(looked));
  }
  const glm::dvec2 shift = common_shift(found);
  for (const Looked& looked : found) off_px_.push_back(nearest(looked, shift).off_px);
  if (!found.empty()) shift_px_.push_back(glm::length(shift));
}

Figure Measurement::figure() const {
  Figure figure{frames_, looked_at_, off_px_.size(), {}, {}};
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
