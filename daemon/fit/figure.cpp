#include "daemon/fit/figure.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "daemon/fit/light_edge.hpp"
#include "daemon/fit/visible_edges.hpp"
#include "daemon/tracking/photometry.hpp"

namespace previz::fit {
namespace {

// find_light() reaches about 2 px; these are the lines that it is begun from, the nearest first.
constexpr double lines_px[] = {0, -3, 3, -6, 6};

// Returns how far the ends of the picture's edge are from the piece, px, across it, in the mean.
double distance(const Segment& piece, const tracking::EdgeFit& fit) {
  const glm::dvec2 along = glm::normalize(piece.b - piece.a), across(-along.y, along.x);
  return 0.5 * (std::abs(glm::dot(fit.a - piece.a, across)) +
                std::abs(glm::dot(fit.b - piece.b, across)));
}

std::optional<double> find(const tracking::Luminance& luminance, const PinholeIntrinsics& lens,
                           const Segment& piece) {
  const glm::dvec2 along = glm::normalize(piece.b - piece.a), across(-along.y, along.x);
  for (const double line : lines_px) {
    const glm::dvec2 shift = line * across;
    if (const auto fit = find_light(luminance, lens, piece.a + shift, piece.b + shift))
      if (const double off = distance(piece, *fit); off <= reach_px) return off;
  }
  return {};
}

double percentile(std::vector<double> values, double share) {
  const auto nth = values.begin() + std::ptrdiff_t(std::llround(share * double(values.size() - 1)));
  std::ranges::nth_element(values, nth);
  return *nth;
}

}  // namespace

void Measurement::look(const Frame& frame, const glm::dmat4& world_from_camera) {
  const tracking::Photometry photometry(camera_.response);
  const auto luminance = [&](int x, int y) { return photometry.luminance(frame, x, y); };
  ++frames_;
  for (const Segment& piece : measurable_pieces(model_, camera_.intrinsics, world_from_camera)) {
    ++looked_at_;
    if (const auto off = find(luminance, camera_.intrinsics, piece)) off_px_.push_back(*off);
  }
}

Figure Measurement::figure() const {
  Figure figure{frames_, looked_at_, off_px_.size(), {}, {}};
  if (looked_at_ < least_pieces)
    figure.why = "the pictures show too few straight edges of the model";
  else if (off_px_.size() < least_pieces)
    figure.why = "the pictures have edges of light at too few of the model's";
  else
    figure.off = Figure::Off{percentile(off_px_, 0.5), percentile(off_px_, 0.9)};
  return figure;
}

}  // namespace previz::fit
