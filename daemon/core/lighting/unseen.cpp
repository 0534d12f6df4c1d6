#include "daemon/core/lighting/unseen.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/lighting/luminance.hpp"

namespace previz::lighting {
namespace {

using std::numbers::pi;

constexpr int sectors = 72;
constexpr double sector_rad = 2 * pi / sectors;
constexpr double band_rad = 10 * pi / 180;
constexpr double outlier = 8;  // times the band's median luminance

// Returns a direction in camera axes; psi goes from x to y around the optical axis.
glm::dvec3 camera_direction(double off_axis, double psi) {
  return {std::sin(off_axis) * std::cos(psi), std::sin(off_axis) * std::sin(psi),
          std::cos(off_axis)};
}

struct Edge {
  std::array<double, sectors> limit_rad{};  // angle off axis at which the picture ends
  std::array<glm::vec3, sectors> radiance{};
  glm::vec3 mean{0};
  double left_out = 0;  // share of the band's solid angle
};

double limit_rad(const Fisheye& lens, double psi) {
  double seen = 0, unseen = lens.max_angle_rad();
  const auto sees = [&](double angle) {
    const auto pixel = lens.project(camera_direction(angle, psi));
    return pixel && lens.pixel_at(*pixel);
  };
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (seen + unseen);
    (sees(middle) ? seen : unseen) = middle;
  }
  return seen;
}

Edge edge_of(const HdrPicture& picture, const Fisheye& lens) {
  struct Sample {
    int sector;
    double weight;
    glm::vec3 radiance;
  };
  constexpr int steps_out = 20, steps_around = 10;
  Edge edge;
  std::vector<Sample> samples;
  for (int s = 0; s < sectors; ++s) {
    const double limit = limit_rad(lens, (s + 0.5) * sector_rad);
    edge.limit_rad[static_cast<std::size_t>(s)] = limit;
    const double start = std::max(0.0, limit - band_rad);
    for (int k = 0; k < steps_out * steps_around; ++k) {
      const int around = k % steps_around, out = k / steps_around;
      const double psi = (s + (around + 0.5) / steps_around) * sector_rad;
      const double angle = start + (out + 0.5) / steps_out * (limit - start);
      const auto pixel = lens.project(camera_direction(angle, psi));
      const auto index = pixel ? lens.pixel_at(*pixel) : std::nullopt;
      if (index) samples.push_back({s, std::sin(angle), picture.radiance[*index]});
    }
  }
  if (samples.empty()) return edge;

  std::vector<double> luminances;
  for (const Sample& sample : samples) luminances.push_back(luminance(sample.radiance));
  const auto middle = luminances.begin() + static_cast<std::ptrdiff_t>(luminances.size() / 2);
  std::nth_element(luminances.begin(), middle, luminances.end());
  const double brightest = outlier * *middle;

  std::array<double, sectors> weights{};
  double weight = 0, left_out = 0;
  for (const Sample& sample : samples) {
    if (luminance(sample.radiance) > brightest) {
      left_out += sample.weight;
      continue;
    }
    const auto s = static_cast<std::size_t>(sample.sector);
    edge.radiance[s] += static_cast<float>(sample.weight) * sample.radiance;
    edge.mean += static_cast<float>(sample.weight) * sample.radiance;
    weights[s] += sample.weight;
    weight += sample.weight;
  }
  edge.mean /= static_cast<float>(weight);
  edge.left_out = left_out / (weight + left_out);
  for (std::size_t s = 0; s < sectors; ++s)
    edge.radiance[s] =
        weights[s] > 0 ? edge.radiance[s] / static_cast<float>(weights[s]) : edge.mean;
  return edge;
}

glm::vec3 continued(const Edge& edge, const glm::dvec3& direction) {
  const double psi = std::atan2(direction.y, direction.x);
  const double position = psi / sector_rad - 0.5 + sectors;
  const auto first = static_cast<std::size_t>(position) % sectors;
  const auto second = (first + 1) % sectors;
  const double between = position - std::floor(position);
  const double limit = glm::mix(edge.limit_rad[first], edge.limit_rad[second], between);
  const double angle = std::acos(std::clamp(direction.z, -1.0, 1.0));
  const double t = std::clamp((angle - limit) / std::max(pi - limit, 1e-9), 0.0, 1.0);
  const glm::vec3 here =
      glm::mix(edge.radiance[first], edge.radiance[second], static_cast<float>(between));
  return glm::mix(here, edge.mean, static_cast<float>(t * t * (3 - 2 * t)));
}

// Adds fill(i, j, world direction of the texel's centre) to the unseen part of every texel.
template <typename Fill>
void fill_each(Resampled& map, const Fill& fill) {
  for (int j = 0; j < map.size; ++j) {
    for (int i = 0; i < map.size; ++i) {
      const auto t = static_cast<std::size_t>(j * map.size + i);
      if (map.seen[t] < 1)
        map.radiance[t] += (1 - map.seen[t]) * fill(i, j, texel_direction(map.size, i, j));
    }
  }
}

// Returns the solid angle that was filled by the fallback.
template <typename Fallback>
double fill_from(const Resampled& elsewhere, const Fallback& fallback, Resampled& map) {
  const int step = map.size / elsewhere.size;
  double left = 0;
  fill_each(map, [&](int i, int j, const glm::vec3& direction) {
    const auto e = static_cast<std::size_t>(j / step * elsewhere.size + i / step);
    const float seen = elsewhere.seen[e];
    left += (1 - map.seen[static_cast<std::size_t>(j * map.size + i)]) * (1 - seen);
    return seen == 0 ? fallback(direction) : elsewhere.radiance[e] / seen;
  });
  return left * texel_sr(map.size);
}

}  // namespace

void fill_unseen(const HdrPicture& picture, const Fisheye& lens, const Viewpoint& viewpoint,
                 const set::Lighting& settings, const Resampled* elsewhere, Resampled& map,
                 std::vector<std::string>& notes) {
  if (settings.unseen == set::UnseenRule::constant) {
    const glm::vec3 radiance(settings.unseen_radiance);
    fill_each(map, [&](int, int, const glm::vec3&) { return radiance; });
    return;
  }

  const Edge edge = edge_of(picture, lens);
  bool edge_used = false;
  const auto horizon = [&](const glm::vec3& direction) {
    edge_used = true;
    const auto in_camera = viewpoint.camera_direction(glm::dvec3(direction));
    return in_camera ? continued(edge, glm::normalize(*in_camera)) : edge.mean;
  };
  if (settings.unseen == set::UnseenRule::horizon || !elsewhere)
    fill_each(map, [&](int, int, const glm::vec3& direction) { return horizon(direction); });
  else if (const double left_sr = fill_from(*elsewhere, horizon, map); left_sr > 0)
    notes.push_back(fmt::format("{} {}; the picture's edge is extended there", area_words(left_sr),
                                settings.unseen == set::UnseenRule::mirror
                                    ? "is not in the mirrored picture either"
                                    : "was not seen by the film camera either"));
  if (edge_used && edge.left_out > 0)
    notes.push_back(fmt::format(
        "{:.1f} % of the band at the picture's edge is more than {} times as bright as its median "
        "and was not extended into the unseen part",
        100 * edge.left_out, outlier));
}

}  // namespace previz::lighting
