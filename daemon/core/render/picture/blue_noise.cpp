#include "daemon/core/render/picture/blue_noise.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace previz::render {
namespace {

// How far a dot fills its surroundings, in pixels (Ulichney's choice).
constexpr double dot_sigma = 1.5;
// One place in so many is a dot in the pattern from which the ranks are counted down and up.
constexpr std::size_t places_a_dot = 10;

// Dots in a square that repeats, and how full each place of it is.
class Dots {
 public:
  explicit Dots(std::size_t side) : side_(side), is_dot_(side * side), fullness_(side * side) {
    for (std::size_t d = 0; d < side; ++d) {
      const double nearest = static_cast<double>(std::min(d, side - d));
      falloff_.push_back(std::exp(-nearest * nearest / (2 * dot_sigma * dot_sigma)));
    }
  }

  void set(std::size_t place, bool is_dot) {
    is_dot_[place] = is_dot;
    const std::size_t x = place % side_, y = place / side_;
    for (std::size_t j = 0; j < side_; ++j)
      for (std::size_t i = 0; i < side_; ++i)
        fullness_[j * side_ + i] += (is_dot ? 1 : -1) * falloff_[(i + side_ - x) % side_] *
                                    falloff_[(j + side_ - y) % side_];
  }
  // The dot with the most dots around, and the place without one that has the fewest.
  std::size_t tightest_cluster() const { return extreme(true, 1); }
  std::size_t largest_void() const { return extreme(false, -1); }

 private:
  std::size_t extreme(bool among_dots, double sign) const {
    std::size_t best = is_dot_.size();
    for (std::size_t i = 0; i < is_dot_.size(); ++i)
      if (is_dot_[i] == among_dots &&
          (best == is_dot_.size() || sign * fullness_[i] > sign * fullness_[best]))
        best = i;
    return best;
  }

  std::size_t side_;
  std::vector<bool> is_dot_;
  std::vector<double> fullness_, falloff_;
};

// Returns a tenth of the places as dots, moved about until none fits better elsewhere.
Dots evenly_spread(std::size_t side) {
  Dots dots(side);
  std::vector<std::size_t> places(side * side);
  std::iota(places.begin(), places.end(), 0);
  std::mt19937 random(1);
  for (std::size_t i = 0; i < places.size() / places_a_dot; ++i) {
    std::swap(places[i], places[i + random() % (places.size() - i)]);
    dots.set(places[i], true);
  }
  for (std::size_t moves = 0; moves < places.size(); ++moves) {
    const std::size_t from = dots.tightest_cluster();
    dots.set(from, false);
    const std::size_t to = dots.largest_void();
    dots.set(to, true);
    if (to == from) break;
  }
  return dots;
}

}  // namespace

std::vector<float> blue_noise(std::uint32_t side) {
  const std::size_t places = std::size_t{side} * side;
  const Dots first = evenly_spread(side);
  std::vector<float> thresholds(places);
  const auto rank = [&](std::size_t place, std::size_t at) {
    thresholds[place] = (static_cast<float>(at) + 0.5f) / static_cast<float>(places);
  };
  Dots fewer = first;
  const std::size_t count = places / places_a_dot;
  for (std::size_t at = count; at > 0; --at) {
    const std::size_t place = fewer.tightest_cluster();
    fewer.set(place, false);
    rank(place, at - 1);
  }
  Dots more = first;
  for (std::size_t at = count; at < places; ++at) {
    const std::size_t place = more.largest_void();
    more.set(place, true);
    rank(place, at);
  }
  return thresholds;
}

}  // namespace previz::render
