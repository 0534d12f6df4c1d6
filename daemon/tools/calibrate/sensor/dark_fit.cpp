#include "daemon/tools/calibrate/sensor/dark_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <vector>

#include "daemon/tools/calibrate/sensor/signals.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr int tiles = 8;  // per side

// Sums over the pictures, one per pixel.
struct DarkSums {
  int width = 0, height = 0, pictures = 0;
  std::vector<glm::dvec3> sum, squares;

  void add(const SignalPicture& picture) {
    if (pictures++ == 0) {
      width = picture.width;
      height = picture.height;
      sum.resize(picture.signal.size());
      squares.resize(picture.signal.size());
    }
    for (std::size_t p = 0; p < sum.size(); ++p) {
      sum[p] += picture.signal[p];
      squares[p] += picture.signal[p] * picture.signal[p];
    }
  }

  glm::dvec3 mean(std::size_t pixel) const { return sum[pixel] / double(pictures); }
};

glm::dvec3 median_of(const DarkSums& sums) {
  glm::dvec3 result;
  for (int channel = 0; channel < 3; ++channel) {
    std::vector<double> values;
    for (std::size_t p = 0; p < sums.sum.size(); ++p) values.push_back(sums.mean(p)[channel]);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    result[channel] = *middle;
  }
  return result;
}

bool is_hot(const glm::dvec3& mean, const glm::dvec3& median) {
  return std::max({mean.r - median.r, mean.g - median.g, mean.b - median.b}) > hot_signal;
}

// Sums over the parts of the picture, from which each part's mean follows.
struct Parts {
  std::vector<glm::dvec3> sum = std::vector<glm::dvec3>(tiles * tiles);
  std::vector<std::size_t> count = std::vector<std::size_t>(tiles * tiles);

  void add(const DarkSums& sums, std::size_t pixel) {
    const auto width = static_cast<std::size_t>(sums.width);
    const auto height = static_cast<std::size_t>(sums.height);
    const std::size_t tile = pixel / width * tiles / height * tiles + pixel % width * tiles / width;
    sum[tile] += sums.mean(pixel);
    ++count[tile];
  }

  void insist_on_darkness(double level) const {
    double darkest = 1, brightest = 0;
    for (std::size_t t = 0; t < sum.size(); ++t) {
      if (count[t] == 0) continue;
      const glm::dvec3 mean = sum[t] / double(count[t]);
      const double value = (mean.r + mean.g + mean.b) / 3;
      darkest = std::min(darkest, value);
      brightest = std::max(brightest, value);
    }
    if (brightest - darkest > std::max(0.1 * level, 1.0 / 255))
      throw Error(
          fmt::format("light leak: part of the pictures is at {:.4f} of white, another at "
                      "{:.4f}; cover the lens",
                      brightest, darkest));
  }
};

DarkSums sums_of(PictureSource& source, const ResponseCurve& response) {
  DarkSums sums;
  while (const std::optional<NamedFrame> next = source.next()) {
    const SignalPicture picture = read_signals(next->frame, response);
    if (sums.pictures > 0 && (picture.width != sums.width || picture.height != sums.height))
      throw Error(fmt::format("{}: has {}x{} pixels, earlier ones {}x{}", next->name, picture.width,
                              picture.height, sums.width, sums.height));
    sums.add(picture);
  }
  if (sums.pictures == 0)
    throw Error("there are no pictures; give some that were taken with the lens covered");
  return sums;
}

}  // namespace

DarkFit fit_dark(PictureSource& source, const ResponseCurve& response) {
  const DarkSums sums = sums_of(source, response);
  DarkFit fit;
  fit.pictures = sums.pictures;
  const glm::dvec3 median = median_of(sums);
  Parts parts;
  glm::dvec3 all(0), variance(0);
  for (std::size_t p = 0; p < sums.sum.size(); ++p) {
    const glm::dvec3 mean = sums.mean(p);
    if (is_hot(mean, median)) {
      ++fit.hot_pixels;
      continue;
    }
    parts.add(sums, p);
    all += mean;
    if (sums.pictures > 1)
      variance += (sums.squares[p] - double(sums.pictures) * mean * mean) / (sums.pictures - 1.0);
  }
  const auto counted = static_cast<double>(sums.sum.size() - fit.hot_pixels);
  fit.level = all / counted;
  fit.noise = glm::sqrt(glm::max(variance / counted, 0.0));
  parts.insist_on_darkness((fit.level.r + fit.level.g + fit.level.b) / 3);
  if (std::max({fit.level.r, fit.level.g, fit.level.b}) > max_dark_level)
    throw Error(
        fmt::format("the pictures are at {:.3f} of white, above {:g}: the lens is not "
                    "covered",
                    std::max({fit.level.r, fit.level.g, fit.level.b}), max_dark_level));
  return fit;
}

}  // namespace previz::calibrate
