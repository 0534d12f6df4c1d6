#include "daemon/core/fit/shift.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace previz::fit {
namespace {

constexpr double between_votes_px = 0.5;
constexpr int votes_to_reach = int(reach_px / between_votes_px),
              votes_aside = 2 * votes_to_reach + 1;

glm::dvec2 shift_of(int x, int y) {
  return between_votes_px * glm::dvec2(x - votes_to_reach, y - votes_to_reach);
}

}  // namespace

const Light& nearest(const EdgeSample& sample, const glm::dvec2& shift) {
  const double at = glm::dot(sample.normal, shift);
  return *std::ranges::min_element(
      sample.lights, {}, [&](const Light& light) { return std::abs(light.along_normal_px - at); });
}

double agreement(const EdgeSample& sample, const glm::dvec2& shift, double within_px) {
  const double off = nearest(sample, shift).along_normal_px - glm::dot(sample.normal, shift);
  return std::max(0.0, 1 - off * off / (within_px * within_px));
}

Votes::Votes() : sums_(std::size_t(votes_aside) * votes_aside) {}

void Votes::add(const EdgeSample& sample) {
  ++pieces_;
  std::size_t i = 0;
  for (int y = 0; y < votes_aside; ++y)
    for (int x = 0; x < votes_aside; ++x) sums_[i++] += agreement(sample, shift_of(x, y));
}

void Votes::add(const Votes& others) {
  pieces_ += others.pieces_;
  for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] += others.sums_[i];
}

Votes Votes::without(const Votes& some) const {
  Votes rest = *this;
  rest.pieces_ -= some.pieces_;
  for (std::size_t i = 0; i < sums_.size(); ++i) rest.sums_[i] -= some.sums_[i];
  return rest;
}

glm::dvec2 Votes::best() const {
  glm::dvec2 best(0);
  double most = -1;
  std::size_t i = 0;
  for (int y = 0; y < votes_aside; ++y)
    for (int x = 0; x < votes_aside; ++x) {
      const glm::dvec2 shift = shift_of(x, y);
      const double sum = sums_[i++] - share_per_px * double(pieces_) * glm::length(shift);
      if (sum > most) most = sum, best = shift;
    }
  return best;
}

double Votes::agreed(const glm::dvec2& shift) const {
  const glm::ivec2 at = glm::ivec2(glm::round(shift / between_votes_px)) + votes_to_reach;
  return sums_[std::size_t(at.y) * votes_aside + std::size_t(at.x)];
}

}  // namespace previz::fit
