#include "daemon/core/render/world/light_change.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <utility>

#include "shaders/lib/octahedral.h"

namespace previz::render {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
// Cells a side of the octahedral map. They overlap, so that a lamp that moves a little changes them
// a little.
constexpr int cells_a_side = 8;
// A lamp is another one if it moved by 1 / 20 of a radian or of a metre.
constexpr double lamp_moves = 20;
// A directional lamp is the same as one that was found within so many radians of it.
constexpr double most_apart = 0.1;
// What is averaged may be off what is there now by this share: somewhat more than lamps tremble by.
constexpr double most_off = 0.03;

// Adds light from a direction to the four cells around it.
void add(std::vector<glm::dvec3>& cells, const glm::dvec2& at, const glm::dvec3& light) {
  const glm::dvec2 scaled = glm::clamp((at + 1.0) * (0.5 * cells_a_side) - 0.5, glm::dvec2(0),
                                       glm::dvec2(cells_a_side - 1));
  const glm::ivec2 low = glm::min(glm::ivec2(scaled), glm::ivec2(cells_a_side - 2));
  const glm::dvec2 f = scaled - glm::dvec2(low);
  for (int y = 0; y < 2; ++y)
    for (int x = 0; x < 2; ++x)
      cells[static_cast<std::size_t>((low.y + y) * cells_a_side + low.x + x)] +=
          (x == 0 ? 1 - f.x : f.x) * (y == 0 ? 1 - f.y : f.y) * light;
}

double relative(const glm::dvec3& a, const glm::dvec3& b) {
  const double most = largest_channel(glm::max(a, b));
  return most > 0 ? largest_channel(glm::abs(a - b)) / most : 0.0;
}

double change_of_lamp(const set::Light& before, const set::Light& now) {
  const bool is_another = before.type != now.type || before.width_m != now.width_m ||
                          before.height_m != now.height_m || before.radius_m != now.radius_m ||
                          before.inner_cone_rad != now.inner_cone_rad ||
                          before.outer_cone_rad != now.outer_cone_rad;
  if (is_another) return 1;
  const auto mixed = [](const set::Light& lamp) {
    return lamp.gain_mixed * lamp.tint * lamp.emission;
  };
  const auto both = [&](const set::Light& lamp) {
    return mixed(lamp) + lamp.gain_real * lamp.emission;
  };
  const double dimmed =
      std::max(relative(both(before), both(now)), relative(mixed(before), mixed(now)));
  const double moved = glm::length(now.position - before.position) +
                       glm::length(now.direction - before.direction) +
                       glm::length(now.up - before.up) +
                       std::abs(now.angular_radius_rad - before.angular_radius_rad);
  return dimmed + lamp_moves * moved;
}

// Returns the lamp that was nearest to where this one is, or null if there was none.
const set::Light* nearest_to(const set::Light& lamp, const std::vector<set::Light>& lamps) {
  const set::Light* nearest = nullptr;
  double least = most_apart;
  for (const set::Light& other : lamps)
    if (const double apart = glm::length(other.direction - lamp.direction); apart < least) {
      least = apart;
      nearest = &other;
    }
  return nearest;
}

// Returns by how much lamps that have moved change the light, each by its share of `all`. How much
// light there is and where it comes from is compared by the cells.
double change_of_suns(const std::vector<set::Light>& before, const std::vector<set::Light>& now,
                      const glm::dvec3& all) {
  double change = 0;
  const double total = largest_channel(all);
  for (const set::Light& sun : now) {
    const set::Light* was = nearest_to(sun, before);
    if (!was || !(total > 0)) continue;
    const double share = largest_channel(sun.emission) / (4 * std::numbers::pi * total);
    change += std::min(share, 1.0) * lamp_moves * glm::length(sun.direction - was->direction);
  }
  return change;
}

void approach(LightCells& mean, const LightCells& now, double share) {
  for (std::size_t i = 0; i < now.size(); ++i) mean[i] += share * (now[i] - mean[i]);
}

void approach(set::Light& mean, const set::Light& now, double share) {
  mean.emission += share * (now.emission - mean.emission);
  mean.tint += share * (now.tint - mean.tint);
  mean.gain_mixed += share * (now.gain_mixed - mean.gain_mixed);
  mean.gain_real += share * (now.gain_real - mean.gain_real);
  mean.position += share * (now.position - mean.position);
  mean.direction += share * (now.direction - mean.direction);
  mean.up += share * (now.up - mean.up);
  mean.angular_radius_rad += share * (now.angular_radius_rad - mean.angular_radius_rad);
}

}  // namespace

double largest_channel(const glm::dvec3& v) {
  return std::max({v.r, v.g, v.b});
}

LightCells light_cells(const EncodedEnvironment& environment) {
  const std::size_t size = environment.size;
  const std::size_t bins = std::min<std::size_t>(size, 64);
  std::vector<glm::dvec3> binned(bins * bins, glm::dvec3(0));
  for (std::size_t j = 0; j < size; ++j)
    for (std::size_t i = 0; i < size; ++i)
      binned[j * bins / size * bins + i * bins / size] +=
          glm::dvec3(environment.radiance[(j + 1) * (size + 2) + i + 1]);
  LightCells cells(std::size_t{cells_a_side} * cells_a_side, glm::dvec3(0));
  for (std::size_t j = 0; j < bins; ++j)
    for (std::size_t i = 0; i < bins; ++i)
      add(cells, (glm::dvec2(i, j) + 0.5) * (2.0 / static_cast<double>(bins)) - 1.0,
          binned[j * bins + i] / static_cast<double>(size * size));
  return cells;
}

double change_of_light(const LightCells& before, const LightCells& now) {
  double change = 0, all_before = 0, all_now = 0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    change += largest_channel(glm::abs(now[i] - before[i]));
    all_before += largest_channel(before[i]);
    all_now += largest_channel(now[i]);
  }
  const double all = std::max(all_before, all_now);
  return all > 0 ? change / all : 0;
}

double change_of_lamps(const std::vector<set::Light>& before, const std::vector<set::Light>& now) {
  if (before.size() != now.size()) return 1;
  double change = 0;
  for (std::size_t i = 0; i < now.size(); ++i)
    change = std::max(change, change_of_lamp(before[i], now[i]));
  return change;
}

void LightChange::see(const EncodedEnvironment& environment) {
  see(light_cells(environment));
}

void LightChange::see(LightCells environment) {
  environment_ = std::move(environment);
  is_seen_anew_ = true;
}

void LightChange::see(std::vector<set::Light> lamps) {
  is_seen_anew_ |= change_of_lamps(lamps_, lamps) > 0;
  lamps_ = std::move(lamps);
}

double LightChange::change(const State& before, const State& now) {
  glm::dvec3 all(0);
  for (const glm::dvec3& cell : now.mixed) all += cell;
  return std::max({change_of_light(before.mixed, now.mixed), change_of_light(before.real, now.real),
                   change_of_lamps(before.lamps, now.lamps),
                   change_of_suns(before.suns, now.suns, all)});
}

LightChange::State LightChange::state() const {
  State now;
  now.real = environment_;
  now.real.resize(std::size_t{cells_a_side} * cells_a_side, glm::dvec3(0));
  now.mixed = now.real;
  for (const set::Light& lamp : lamps_) {
    if (lamp.type != set::LightType::directional) {
      now.lamps.push_back(lamp);
      continue;
    }
    now.suns.push_back(lamp);
    const glm::dvec2 at(octahedral_point(glm::vec3(-lamp.direction)));
    const glm::dvec3 light = lamp.emission / (4 * std::numbers::pi);
    add(now.real, at, lamp.gain_real * light);
    add(now.mixed, at, lamp.gain_mixed * lamp.tint * light);
  }
  return now;
}

// Moves the mean towards what is there now. A lamp that comes is its own mean.
void LightChange::follow(const State& now, double share) {
  approach(mean_->mixed, now.mixed, share);
  approach(mean_->real, now.real, share);
  for (std::size_t i = 0; i < now.lamps.size(); ++i) approach(mean_->lamps[i], now.lamps[i], share);
  std::vector<set::Light> suns;
  for (const set::Light& sun : now.suns) {
    const set::Light* was = nearest_to(sun, mean_->suns);
    suns.push_back(was ? *was : sun);
    approach(suns.back(), sun, share);
  }
  mean_->suns = std::move(suns);
}

double LightChange::frames() {
  if (mean_ && !is_seen_anew_ && is_settled_) return infinity;
  State now = state();
  if (!mean_) {
    mean_ = std::move(now);
    counted_ = 1;
    return 0;
  }
  // With the weight of `frames` frames the mean is off by `off` * frames / (frames + 1).
  const double off = change(*mean_, now);
  const double frames = off > most_off ? most_off / (off - most_off) : infinity;
  counted_ = std::min(counted_, frames);
  is_settled_ = off == 0;
  is_seen_anew_ = false;
  if (counted_ < least_frames) {
    mean_ = std::move(now);
    counted_ = 0;
  } else {
    follow(now, 1 / (1 + counted_));
  }
  counted_ = std::min(counted_ + 1, most_frames);
  return frames;
}

}  // namespace previz::render
