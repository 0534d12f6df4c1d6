#include "daemon/render/composite.hpp"

#include <algorithm>
#include <glm/common.hpp>

#include "daemon/render/each_pixel.hpp"

namespace previz::render {
namespace {

// The means that follow from one pixel's sums, in double precision.
struct Means {
  glm::dvec3 mixed, diff, mixed_square, diff_square;
  double mask, depth_sum, hits, difference_only, samples;
};

Means means(const gpu::GpuPixel& p) {
  const auto sum = [](const glm::vec4& high, const glm::vec4& low) {
    return glm::dvec4(high) + glm::dvec4(low);
  };
  const glm::dvec4 mixed = sum(p.mixed_high, p.mixed_low);
  const glm::dvec4 diff = sum(p.diff_high, p.diff_low);
  const glm::dvec4 mixed_square = sum(p.square_mixed_high, p.square_mixed_low);
  const glm::dvec4 diff_square = sum(p.square_diff_high, p.square_diff_low);
  const double samples = std::max(diff_square.w, 1.0);
  return {glm::dvec3(mixed) / samples,
          glm::dvec3(diff) / samples,
          glm::dvec3(mixed_square) / samples,
          glm::dvec3(diff_square) / samples,
          mixed.w / samples,
          diff.w,
          p.normal.w,
          mixed_square.w / samples,
          samples};
}

// Returns the variance of a mean of n samples from the means of values and squares.
glm::dvec3 variance_of_mean(const glm::dvec3& mean, const glm::dvec3& square, double n) {
  if (n < 2) return glm::dvec3(0);
  return glm::max(square - mean * mean, glm::dvec3(0)) / (n - 1);
}

// Reads pixel i of interleaved RGB; the pixel is black where there is no plate.
glm::dvec3 pixel_of(const std::vector<double>& rgb, std::size_t i) {
  return rgb.empty() ? glm::dvec3(0) : glm::dvec3(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]);
}

// Returns the gain g of shaders/README.md, "The composite": the factor of the worlds' difference
// when it is added to the camera's radiance.
double gain(const CompositeRule& rule, double camera, double real, double plate_variance) {
  switch (rule.kind) {
    case set::Composite::additive:
      return 1;
    case set::Composite::ratio:
      return real > 0 ? camera / real : 0;
    case set::Composite::hybrid: {
      const double s2 = plate_variance + rule.floor * rule.floor;
      const double denominator = real * real + s2;
      return denominator > 0 ? (real * camera + s2) / denominator : 1;
    }
  }
  return 1;
}

}  // namespace

PlateRadiance plate_radiance(const Plate& plate, const lighting::Response& response,
                             double exposure) {
  const std::vector<double>& inverse = response.inverse();
  PlateRadiance of_code;
  for (std::size_t code = 0; code < inverse.size(); ++code) {
    const std::size_t low = code > 0 ? code - 1 : 0;
    const std::size_t high = std::min(code + 1, inverse.size() - 1);
    const double step = (inverse[high] - inverse[low]) / static_cast<double>(high - low) / exposure;
    of_code.value.push_back(inverse[code] / exposure);
    of_code.variance.push_back(step * step / 12);
  }
  PlateRadiance result{std::vector<double>(plate.samples.size()),
                       std::vector<double>(plate.samples.size())};
  each_pixel(plate.samples.size() / 3, [&](std::size_t pixel) {
    for (std::size_t i = 3 * pixel; i < 3 * pixel + 3; ++i) {
      result.value[i] = of_code.value[plate.samples[i]];
      result.variance[i] = of_code.variance[plate.samples[i]];
    }
  });
  return result;
}

Layers make_layers(int width, int height, std::int64_t samples) {
  Layers layers;
  layers.width = width;
  layers.height = height;
  layers.samples = samples;
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  for (auto* layer : {&layers.composite, &layers.mixed, &layers.real, &layers.diff, &layers.normal,
                      &layers.variance})
    layer->resize(pixels);
  layers.mask.resize(pixels);
  layers.depth.resize(pixels);
  return layers;
}

void composite(Layers& layers, std::size_t first, std::span<const gpu::GpuPixel> pixels,
               const PlateRadiance& plate, const CompositeRule& rule) {
  each_pixel(pixels.size(), [&](std::size_t at) {
    const gpu::GpuPixel& sums = pixels[at];
    const std::size_t i = first + at;
    Means m = means(sums);
    const glm::dvec3 camera = pixel_of(plate.value, i);
    const glm::dvec3 plate_variance = pixel_of(plate.variance, i);
    // Where only the difference was traced, the camera's picture stands for the real world.
    if (m.difference_only > 0) m.mixed = camera + m.diff;
    const double uncovered = 1 - m.mask;
    const glm::dvec3 real = m.mixed - m.diff;
    glm::dvec3 gains;
    for (int c = 0; c < 3; ++c) gains[c] = gain(rule, camera[c], real[c], plate_variance[c]);
    layers.composite[i] = glm::vec3(m.mask * m.mixed + uncovered * (camera + gains * m.diff));
    layers.mixed[i] = glm::vec3(m.mixed);
    layers.real[i] = glm::vec3(real);
    layers.diff[i] = glm::vec3(m.diff);
    layers.variance[i] = glm::vec3(
        m.mask * m.mask * variance_of_mean(m.mixed, m.mixed_square, m.samples) +
        uncovered * uncovered * gains * gains * variance_of_mean(m.diff, m.diff_square, m.samples));
    layers.mask[i] = static_cast<float>(m.mask);
    layers.depth[i] = static_cast<float>(m.hits > 0 ? m.depth_sum / m.hits : 0);
    const glm::dvec3 normal(sums.normal.x, sums.normal.y, sums.normal.z);
    layers.normal[i] = glm::vec3(m.hits > 0 ? normal / m.hits : glm::dvec3(0));
  });
}

}  // namespace previz::render
