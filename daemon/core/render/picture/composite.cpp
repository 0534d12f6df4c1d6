#include "daemon/core/render/picture/composite.hpp"

#include <algorithm>
#include <glm/common.hpp>

#include "daemon/core/render/picture/each_pixel.hpp"

namespace previz::render {
namespace {

// The means that follow from one pixel's sums, in double precision.
struct Means {
  glm::dvec3 mixed, diff, uncovered, square;
  double mask, depth_sum, hits, difference_only, samples;
};

Means means(const gpu::GpuPixel& p) {
  const auto sum = [](const glm::vec4& high, const glm::vec4& low) {
    return glm::dvec4(high) + glm::dvec4(low);
  };
  const glm::dvec4 mixed = sum(p.mixed_high, p.mixed_low);
  const glm::dvec4 diff = sum(p.diff_high, p.diff_low);
  const glm::dvec4 uncovered = sum(p.uncovered_high, p.uncovered_low);
  const glm::dvec4 square = sum(p.square_high, p.square_low);
  const double samples = std::max(square.w, 1.0);
  return {glm::dvec3(mixed) / samples,
          glm::dvec3(diff) / samples,
          glm::dvec3(uncovered) / samples,
          glm::dvec3(square) / samples,
          mixed.w / samples,
          diff.w,
          p.normal.w,
          uncovered.w / samples,
          samples};
}

// Returns the variance of a mean of n samples from the means of values and squares.
glm::dvec3 variance_of_mean(const glm::dvec3& mean, const glm::dvec3& square, double n) {
  if (n < 2) return glm::dvec3(0);
  return glm::max(square - mean * mean, glm::dvec3(0)) / (n - 1);
}

// Returns the variance of the change. A sample adds Lm in place of Lc where it is covered, and
// Lm - Lr where it is not; the mean of M Lm is that of the change without the uncovered part, but
// for the covariance of M and Lr.
glm::dvec3 variance_of_change(const Means& m, const glm::dvec3& change, const glm::dvec3& camera) {
  if (m.mask <= 0 || m.mask >= 1) return variance_of_mean(change, m.square, m.samples);
  const glm::dvec3 covered = change - m.uncovered;
  return variance_of_mean(change - m.mask * camera,
                          m.square + camera * (m.mask * camera - 2.0 * covered), m.samples);
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

namespace {

double compose_by_rule(const CompositeRule& rule, const MeasuredChannel& camera,
                       const Estimate& e) {
  const double seen = camera.radiance;
  const double through = 1 - e.mask;
  const double plain =
      through * seen + (e.change + (gain(rule, seen, e.real, camera.variance) - 1) * e.uncovered);
  if (camera.clipped <= 0) return plain;
  const double behind = seen + camera.clipped * std::max(e.real - seen, 0.0);
  const double whole = through * behind +
                       (e.change + (gain(rule, behind, e.real, camera.variance) - 1) * e.uncovered);
  return std::min(whole, std::max(seen, plain));
}

}  // namespace

double compose(const CompositeRule& rule, const MeasuredChannel& camera, const Estimate& e) {
  return std::max(compose_by_rule(rule, camera, e), 0.0);
}

std::uint64_t below_zero(const Layers& layers) {
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i < layers.mask.size(); ++i) {
    if (layers.mask[i] > 0) continue;
    for (glm::length_t c = 0; c < 3; ++c)
      if (layers.composite[i][c] == 0 && layers.diff[i][c] < 0) {
        ++pixels;
        break;
      }
  }
  return pixels;
}

double gain_of(const CompositeRule& rule, const MeasuredChannel& camera, const Estimate& e) {
  return e.mask + (1 - e.mask) * gain(rule, camera.radiance, e.real, camera.variance);
}

PlateRadiance plate_radiance(const Plate& plate, const lighting::Response& response,
                             double exposure) {
  const std::vector<double>& inverse = response.inverse();
  const lighting::Clipping clipping = response.clipping();
  PlateRadiance result{{}, plate.samples};
  for (std::size_t code = 0; code < inverse.size(); ++code) {
    const std::size_t low = code > 0 ? code - 1 : 0;
    const std::size_t high = std::min(code + 1, inverse.size() - 1);
    const double step = (inverse[high] - inverse[low]) / static_cast<double>(high - low) / exposure;
    result.of_code.push_back({inverse[code] / exposure, step * step / 12,
                              clipping.share(static_cast<std::uint16_t>(code))});
  }
  return result;
}

MeasuredChannel PlateRadiance::channel(std::size_t pixel, int channel) const {
  if (codes.empty()) return {};
  const std::size_t code = codes[3 * pixel + static_cast<std::size_t>(channel)];
  return of_code[std::min(code, of_code.size() - 1)];
}

Layers make_layers(int width, int height, std::int64_t samples,
                   const std::shared_ptr<Scratch>& scratch) {
  Layers layers(scratch);
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
    const Means m = means(sums);
    glm::dvec3 camera{0}, result{0}, gains{0};  // gains: of an error in the change
    const glm::dvec3 change = m.mask * m.mixed + (1 - m.mask) * m.diff;
    // Where only the difference was traced, the camera's picture stands for the real world.
    const bool is_difference = m.difference_only > 0;
    for (int c = 0; c < 3; ++c) {
      const MeasuredChannel measured = plate.channel(i, c);
      camera[c] = measured.radiance;
      const double real = is_difference ? measured.radiance : m.mixed[c] - m.diff[c];
      const Estimate estimate{change[c], m.mask, m.uncovered[c], real};
      result[c] = compose(rule, measured, estimate);
      gains[c] = gain_of(rule, measured, estimate);
    }
    layers.composite[i] = glm::vec3(result);
    layers.mixed[i] = glm::vec3(is_difference ? camera + m.diff : m.mixed);
    layers.real[i] = glm::vec3(is_difference ? camera : m.mixed - m.diff);
    layers.diff[i] = glm::vec3(m.diff);
    layers.variance[i] = glm::vec3(gains * gains * variance_of_change(m, change, camera));
    layers.mask[i] = static_cast<float>(m.mask);
    layers.depth[i] = static_cast<float>(m.hits > 0 ? m.depth_sum / m.hits : 0);
    const glm::dvec3 normal(sums.normal.x, sums.normal.y, sums.normal.z);
    layers.normal[i] = glm::vec3(m.hits > 0 ? normal / m.hits : glm::dvec3(0));
  });
}

}  // namespace previz::render
