#include "daemon/core/render/passes/denoiser.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/core/render/picture/each_pixel.hpp"
#include "shaders/denoise.spv.h"
#include "shaders/denoise_caustics.spv.h"
#include "shaders/denoise_edges.spv.h"
#include "shaders/denoise_guide.spv.h"
#include "shaders/denoise_variance.spv.h"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// The transform has four levels, with steps of 1, 2, 4 and 8 pixels.
constexpr int wavelet_levels = 4;
// A row's result depends on this many rows above and below it: at every level two steps and one
// more of the guide, the neighbours that give the variance, and those of an edge. A slope comes
// from nearer rows.
constexpr int band_margin =
    3 * ((1 << wavelet_levels) - 1) +
    static_cast<int>(gpu::DENOISE_VARIANCE_REACH + gpu::DENOISE_EDGE_REACH + gpu::HISTORY_REACH);
static_assert(gpu::DENOISE_VARIANCE_REACH >= 2);

// The light of photons has these levels, with steps of 1, 2 and 4 pixels.
constexpr int caustic_levels = 3;
static_assert(caustic_levels <= wavelet_levels);

constexpr Purpose for_filter{"the noise filter",
                             "make the picture smaller, or set quality.denoise to false"};

Buffer texels_for(Device& device, std::size_t count) {
  return create_texel_buffer(device, for_filter, count * sizeof(gpu::vec4),
                             vk::Format::eR32G32B32A32Sfloat, true);
}

}  // namespace

// A mean of n samples, each no brighter than DENOISE_MOST_WHITES, has a standard deviation of at
// most that / sqrt(n). The number of samples is capped, because otherwise the outlier that a single
// sample met would never count as one.
float most_variance(float white, std::int64_t samples) {
  constexpr std::int64_t most_counted = 16;
  const float most = gpu::DENOISE_MOST_WHITES * white;
  return most * most / static_cast<float>(std::clamp<std::int64_t>(samples, 1, most_counted));
}

Denoiser::Denoiser(Device& device, std::size_t most_pixels)
    : device_(device), most_pixels_(most_pixels) {
  make_kernels({&variance_pass_, &guide_pass_, &level_pass_, &caustic_pass_, &edge_pass_}, device,
               passes());
}

std::span<const Pass> Denoiser::passes() {
  static constexpr Pass all[] = {{"denoise_variance", denoise_variance_spv},
                                 {"denoise_guide", denoise_guide_spv},
                                 {"denoise", denoise_spv},
                                 {"denoise_caustics", denoise_caustics_spv},
                                 {"denoise_edges", denoise_edges_spv}};
  return all;
}

void Denoiser::reserve(std::size_t pixels, bool companions, bool caustics) {
  has_caustics_ = caustics;
  for (Buffer& side : caustic_)
    if (const std::size_t count = caustics ? pixels : 1; side.size < count * sizeof(gpu::vec4))
      side = texels_for(device_, count);
  filters_companions_ = companions;
  const auto texels = [&](std::size_t count) { return texels_for(device_, count); };
  if (pixels > pixels_) {
    pixels_ = companion_pixels_ = 0;  // stay 0 if an allocation below throws
    for (int side : {0, 1}) {
      signal_[side] = texels(pixels);
      variance_[side] = texels(pixels);
    }
    for (Buffer* other : {&surface_, &guide_}) *other = texels(pixels);
    albedo_ = create_texel_buffer(device_, for_filter, pixels * 4 * sizeof(std::uint16_t),
                                  vk::Format::eR16G16B16A16Sfloat, true);
    // composite.comp and present.comp use side 0 of the companions, filtered or not.
    uncovered_[0] = texels(pixels);
    real_[0] = texels(pixels);
    uncovered_[1] = texels(1);
    real_[1] = texels(1);
    pixels_ = pixels;
  }
  if (companions && companion_pixels_ < pixels_) {
    uncovered_[1] = texels(pixels_);
    real_[1] = texels(pixels_);
    companion_pixels_ = pixels_;
  }
}

// Each pass writes to the other side, starting from side 0: the variance pass, the levels, the edge
// pass. The first leaves the companions where they are.
constexpr int result_side = (1 + wavelet_levels + 1) % 2;
constexpr int companions_side = (wavelet_levels + 1) % 2;

const Buffer& Denoiser::denoised_signal() const {
  return signal_[result_side];
}
const Buffer& Denoiser::denoised_uncovered() const {
  return uncovered_[filters_companions_ ? 1 : 0];
}
const Buffer& Denoiser::denoised_real() const {
  return real_[filters_companions_ ? companions_side : 0];
}

void Denoiser::record(const vk::raii::CommandBuffer& commands, int width, int rows,
                      bool single_sample, bool has_history) {
  gpu::GpuDenoise constants{static_cast<std::uint32_t>(width),
                            static_cast<std::uint32_t>(rows),
                            1,
                            single_sample && !has_history ? 1u : 0u,
                            filters_companions_ ? 1u : 0u,
                            has_history ? 1u : 0u,
                            has_caustics_ ? 1u : 0u};
  int side = 0, companion = 0, caustic = 0;
  const auto run = [&](Kernel& pass) {
    const Buffers buffers{{"signals", &signal_[side]},
                          {"variances", &variance_[side]},
                          {"surfaces", &surface_},
                          {"albedos", &albedo_},
                          {"caustics", &caustic_[caustic]},
                          {"denoised_caustics", &caustic_[1 - caustic]},
                          {"guides", &guide_},
                          {"uncovered", &uncovered_[0]},
                          {"reals", &real_[companion]},
                          {"denoised_signals", &signal_[1 - side]},
                          {"denoised_variances", &variance_[1 - side]},
                          {"denoised_uncovered", &uncovered_[1]},
                          {"denoised_reals", &real_[1 - companion]}};
    pass.dispatch({commands, constants, buffers}, constants.width * constants.height);
  };
  run(variance_pass_);
  for (int level = 0; level < wavelet_levels; ++level) {
    side = 1 - side;
    constants.step = 1u << level;
    run(guide_pass_);
    run(level_pass_);
    if (has_caustics_ && level < caustic_levels) {
      run(caustic_pass_);
      caustic = 1 - caustic;
    }
    if (filters_companions_) companion = 1 - companion;
  }
  side = 1 - side;
  run(edge_pass_);
}

std::vector<Denoiser::Band> Denoiser::bands(int width, int height) const {
  const auto fitting = static_cast<int>(std::min<std::size_t>(
      most_pixels_ / static_cast<std::size_t>(width), static_cast<std::size_t>(height)));
  if (fitting == height) return {{0, height, 0, height}};
  // A band has at least `band_margin` rows, even if they do not fit: a smaller one would consist
  // mostly of margin that its neighbours compute as well.
  const int rows = std::max(fitting - 2 * band_margin, band_margin);
  std::vector<Band> bands;
  for (int first = 0; first < height; first += rows) {
    const int last = std::min(first + rows, height);
    bands.push_back(
        {first, last, std::max(first - band_margin, 0), std::min(last + band_margin, height)});
  }
  return bands;
}

void Denoiser::read(const Band& band, Layers& layers, const PlateRadiance& plate,
                    const CompositeRule& rule) const {
  const auto width = static_cast<std::size_t>(layers.width);
  const std::size_t top = static_cast<std::size_t>(band.top) * width;
  const std::size_t first = static_cast<std::size_t>(band.first) * width;
  const std::size_t last = static_cast<std::size_t>(band.last) * width;
  const auto signals = download<glm::vec4>(device_, denoised_signal(), last - top);
  const auto variances = download<glm::vec4>(device_, variance_[result_side], last - top);
  std::vector<glm::vec4> uncovered, real;
  if (filters_companions_) {
    uncovered = download<glm::vec4>(device_, denoised_uncovered(), last - top);
    real = download<glm::vec4>(device_, denoised_real(), last - top);
  }
  const auto white = static_cast<float>(layers.white);
  each_pixel(last - first, [&](std::size_t at) {
    const std::size_t i = first + at;
    const glm::vec4& variance = variances[i - top];
    for (int c = 0; c < 3; ++c) {
      const MeasuredChannel measured = plate.channel(i, c);
      Estimate estimate{layers.white * signals[i - top][c], layers.mask[i], 0, 0};
      if (filters_companions_) {
        estimate.uncovered = layers.white * uncovered[i - top][c];
        estimate.real = layers.white * real[i - top][c];
      }
      const auto clean = static_cast<float>(compose(rule, measured, estimate));
      float& composite = layers.composite[i][c];
      float& left = layers.variance[i][c];
      const bool is_highlight = layers.samples > 1 && composite - white > 2 * std::sqrt(left);
      const bool is_bright =
          clean >= gpu::NEARLY_WHITE * white && composite <= gpu::DENOISE_MOST_WHITES * white;
      if (composite >= white && (is_highlight || is_bright)) continue;
      composite = clean;
      const double gain = gain_of(rule, measured, estimate);
      left = static_cast<float>(gain * gain) * white * white * variance.w * variance[c];
    }
  });
}

}  // namespace previz::render
