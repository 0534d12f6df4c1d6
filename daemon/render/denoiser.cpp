#include "daemon/render/denoiser.hpp"

#include <algorithm>

#include "daemon/render/each_pixel.hpp"
#include "shaders/denoise.spv.h"
#include "shaders/denoise_variance.spv.h"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// The transform has four levels, with steps of 1, 2, 4 and 8 pixels.
constexpr int wavelet_levels = 4;
// A row's result depends on this many rows above and below it: two steps of every level, and the
// neighbours that give the variance there. A slope comes from nearer rows.
constexpr int reach =
    2 * ((1 << wavelet_levels) - 1) + static_cast<int>(gpu::DENOISE_VARIANCE_REACH);
static_assert(gpu::DENOISE_VARIANCE_REACH >= 2);

glm::vec3 camera_pixel(const std::vector<double>& camera, std::size_t i) {
  if (camera.empty()) return glm::vec3(0);
  return {camera[3 * i], camera[3 * i + 1], camera[3 * i + 2]};
}

// Returns the part of the camera's picture that shows through the composite. Single precision, like
// the composite's, makes the difference of the two exactly zero in an untouched pixel.
glm::vec3 seen_through(const Layers& layers, const std::vector<double>& camera, std::size_t i) {
  return (1 - layers.mask[i]) * camera_pixel(camera, i);
}

// Returns the unit of a signal: the sensor's white or, where the composite multiplies the camera's
// picture, that picture, so that its texture is not blurred. The floor preserves light that is
// added to black.
struct Scale {
  const Layers& layers;
  const std::vector<double>& camera;
  const CompositeRule& rule;
  float white;

  glm::vec3 operator()(std::size_t i) const {
    if (rule.kind == set::Composite::additive || layers.mask[i] > 0) return glm::vec3(white);
    return camera_pixel(camera, i) + std::max(static_cast<float>(rule.floor), 1e-3f * white);
  }
};

}  // namespace

// A mean of n samples, each no brighter than white, has a standard deviation of at most white /
// sqrt(n). The number of samples is capped, because otherwise the outlier that a single sample met
// would never count as one.
float most_sure_variance(float white, std::int64_t samples) {
  constexpr std::int64_t most_sure_samples = 16;
  return white * white /
         static_cast<float>(std::clamp<std::int64_t>(samples, 1, most_sure_samples));
}

Denoiser::Denoiser(Device& device, std::size_t most_pixels)
    : device_(device),
      most_pixels_(most_pixels),
      variance_pass_(device, "denoise_variance", denoise_variance_spv),
      level_pass_(device, "denoise", denoise_spv) {}

void Denoiser::reserve(std::size_t pixels) {
  if (pixels <= pixels_) return;
  pixels_ = 0;  // stays 0 if an allocation below throws
  const auto texels = [&] {
    return create_texel_buffer(device_, pixels * sizeof(gpu::vec4),
                               vk::Format::eR32G32B32A32Sfloat);
  };
  for (int side : {0, 1}) {
    signal_[side] = texels();
    variance_[side] = texels();
  }
  surface_ = texels();
  pixels_ = pixels;
}

// Each pass writes to the other side, starting from side 0; the variance pass is the first.
constexpr int result_side = (1 + wavelet_levels) % 2;

const Buffer& Denoiser::denoised_signal() const {
  return signal_[result_side];
}

void Denoiser::record(const vk::raii::CommandBuffer& commands, int width, int rows,
                      bool single_sample) {
  gpu::GpuDenoise constants{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(rows), 0,
                            single_sample ? 1u : 0u};
  int side = 0;
  const auto run = [&](Kernel& pass) {
    const Buffers buffers{{"signals", &signal_[side]},
                          {"variances", &variance_[side]},
                          {"surfaces", &surface_},
                          {"denoised_signals", &signal_[1 - side]},
                          {"denoised_variances", &variance_[1 - side]}};
    pass.dispatch({commands, constants, buffers}, constants.width * constants.height);
    side = 1 - side;
  };
  run(variance_pass_);
  for (int level = 0; level < wavelet_levels; ++level) {
    constants.step = 1u << level;
    run(level_pass_);
  }
}

std::vector<Denoiser::Band> Denoiser::bands(int width, int height) const {
  const auto fitting = static_cast<int>(std::min<std::size_t>(
      most_pixels_ / static_cast<std::size_t>(width), static_cast<std::size_t>(height)));
  if (fitting == height) return {{0, height, 0, height}};
  // A band has at least `reach` rows, even if they do not fit: a smaller one would consist mostly
  // of margin that its neighbours compute as well.
  const int rows = std::max(fitting - 2 * reach, reach);
  std::vector<Band> bands;
  for (int first = 0; first < height; first += rows) {
    const int last = std::min(first + rows, height);
    bands.push_back({first, last, std::max(first - reach, 0), std::min(last + reach, height)});
  }
  return bands;
}

void Denoiser::read(const Band& band, Layers& layers, const std::vector<double>& camera,
                    const CompositeRule& rule) const {
  const auto width = static_cast<std::size_t>(layers.width);
  const std::size_t top = static_cast<std::size_t>(band.top) * width;
  const std::size_t first = static_cast<std::size_t>(band.first) * width;
  const std::size_t last = static_cast<std::size_t>(band.last) * width;
  const auto signals = download<glm::vec4>(device_, signal_[result_side], last - top);
  const auto variances = download<glm::vec4>(device_, variance_[result_side], last - top);
  const auto white = static_cast<float>(layers.white);
  const Scale scale{layers, camera, rule, white};
  each_pixel(last - first, [&](std::size_t at) {
    const std::size_t i = first + at;
    const glm::vec4& variance = variances[i - top];
    const glm::vec3 units = scale(i);
    const glm::vec3 denoised =
        seen_through(layers, camera, i) + units * glm::vec3(signals[i - top]);
    const glm::vec3 left = units * units * variance.w * glm::vec3(variance);
    for (int c = 0; c < 3; ++c) {
      if (layers.composite[i][c] >= white && denoised[c] >= gpu::NEARLY_WHITE * white) continue;
      layers.composite[i][c] = denoised[c];
      layers.variance[i][c] = left[c];
    }
  });
}

}  // namespace previz::render
