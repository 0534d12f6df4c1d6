#include "daemon/core/lighting/smoothing.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <utility>

namespace previz::lighting {
namespace {

constexpr float confidence_squared = 5 * 5;
constexpr float most_noise = 4 * 4;  // a ratio to the pictures' own variance

// The sums of differences and of their variances over the squares of one level.
struct Level {
  int width = 0, height = 0;
  std::vector<glm::vec3> difference, variance;

  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * width + x); }
  bool changed(std::size_t i, float noise) const {
    const glm::vec3 d = difference[i] * difference[i], v = confidence_squared * noise * variance[i];
    return d.r > v.r || d.g > v.g || d.b > v.b;
  }
};

Level pixel_level(const HdrPicture& average, const HdrPicture& picture) {
  Level level{picture.width, picture.height, {}, {}};
  const std::size_t pixels = picture.radiance.size();
  level.difference.reserve(pixels);
  level.variance.reserve(pixels);
  for (std::size_t p = 0; p < pixels; ++p) {
    level.difference.push_back(picture.radiance[p] - average.radiance[p]);
    level.variance.push_back(picture.variance[p] + average.variance[p]);
  }
  return level;
}

// Returns the variance of the differences over the variance that the pictures state, 1 to
// most_noise: the median of the squared ratios over 0.4549, which is the median of a squared
// standard normal variable.
float noise_of(const Level& pixels) {
  constexpr std::size_t green = 1, most = 1 << 14;
  std::vector<float> squares;
  for (std::size_t p = 0; p < pixels.difference.size(); p += 1 + pixels.difference.size() / most) {
    const float d = pixels.difference[p][green], v = pixels.variance[p][green];
    if (v > 0) squares.push_back(d * d / v);
  }
  if (squares.empty()) return 1;
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  return std::clamp(*middle / 0.4549f, 1.0f, most_noise);
}

Level coarser(const Level& fine, const std::vector<bool>& left_out) {
  Level coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}, {}};
  const auto size = static_cast<std::size_t>(coarse.width * coarse.height);
  coarse.difference.assign(size, glm::vec3(0));
  coarse.variance.assign(size, glm::vec3(0));
  for (int y = 0; y < fine.height; ++y) {
    for (int x = 0; x < fine.width; ++x) {
      const std::size_t from = fine.at(x, y), to = coarse.at(x / 2, y / 2);
      if (left_out[from]) continue;
      coarse.difference[to] += fine.difference[from];
      coarse.variance[to] += fine.variance[from];
    }
  }
  return coarse;
}

// Returns, for each square of this level, whether it or a square that contains it has changed.
std::vector<bool> changes(const Level& level, float noise) {
  std::vector<bool> changed(level.difference.size());
  for (std::size_t i = 0; i < changed.size(); ++i) changed[i] = level.changed(i, noise);
  if (changed.size() == 1) return changed;
  const Level coarse = coarser(level, changed);
  const std::vector<bool> above = changes(coarse, noise);
  for (int y = 0; y < level.height; ++y)
    for (int x = 0; x < level.width; ++x)
      if (above[coarse.at(x / 2, y / 2)]) changed[level.at(x, y)] = true;
  return changed;
}

}  // namespace

void Smoothing::operator()(HdrPicture& picture, std::int64_t timestamp_ns) {
  if (time_constant_s_ == 0) return;
  const double elapsed_s = 1e-9 * static_cast<double>(timestamp_ns - timestamp_ns_);
  timestamp_ns_ = timestamp_ns;
  if (average_.width == picture.width && average_.height == picture.height) {
    const auto share =
        static_cast<float>(-std::expm1(-std::max(elapsed_s, 0.0) / time_constant_s_));
    const Level pixels = pixel_level(average_, picture);
    const std::vector<bool> changed = changes(pixels, noise_of(pixels));
    for (std::size_t p = 0; p < changed.size(); ++p) {
      if (changed[p]) continue;
      picture.radiance[p] = glm::mix(average_.radiance[p], picture.radiance[p], share);
      picture.variance[p] =
          (1 - share) * (1 - share) * average_.variance[p] + share * share * picture.variance[p];
    }
  }
  average_ = {picture.width, picture.height, picture.radiance, {}, picture.variance};
}

}  // namespace previz::lighting
