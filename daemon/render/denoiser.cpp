#include "daemon/render/denoiser.hpp"

#include <algorithm>
#include <cmath>

#include "shaders/denoise.spv.h"
#include "shaders/denoise_variance.spv.h"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// Levels of the transform: steps of 1, 2, 4 and 8 pixels.
constexpr int wavelet_levels = 4;
// Rows above and below that a row's result depends on: two steps of every level, and the neighbours
// that give the variance there. A slope comes from rows nearer than those.
constexpr int reach =
    2 * ((1 << wavelet_levels) - 1) + static_cast<int>(gpu::DENOISE_VARIANCE_REACH);
static_assert(gpu::DENOISE_VARIANCE_REACH >= 2);

// A channel that comes out at this share of the sensor's white is white: a step of 8 bits below it.
constexpr float nearly_white = 0.99f;

// A mean of n samples, each no brighter than white, deviates by white / sqrt(n) at most. More
// samples than so many do not make it any surer, or what one of them met would never count as an
// outlier.
constexpr std::int64_t most_sure_samples = 16;

bool is_read_as_texels(std::uint32_t binding) {
  return binding <= gpu::BINDING_DENOISE_SURFACE;
}

glm::vec3 camera_pixel(const std::vector<double>& camera, std::size_t i) {
  if (camera.empty()) return glm::vec3(0);
  return {camera[3 * i], camera[3 * i + 1], camera[3 * i + 2]};
}

// What the camera's picture keeps of itself under the composite. In single precision as the
// composite is, so that what is laid over an untouched pixel is exactly nothing.
glm::vec3 seen_through(const Layers& layers, const std::vector<double>& camera, std::size_t i) {
  return (1 - layers.mask[i]) * camera_pixel(camera, i);
}

// Signals are counted in it: the sensor's white, where it is known.
float unit_of(const Layers& layers) {
  return std::isfinite(layers.white) ? static_cast<float>(layers.white) : 1;
}

// What is filtered is counted in the unit or, where the composite multiplies it, in the camera's
// picture, whose texture is then not blurred. The floor keeps what is added to black.
struct Scale {
  const Layers& layers;
  const std::vector<double>& camera;
  const CompositeRule& rule;
  float unit = unit_of(layers);

  glm::vec3 operator()(std::size_t i) const {
    if (rule.kind == set::Composite::additive || layers.mask[i] > 0) return glm::vec3(unit);
    return camera_pixel(camera, i) + std::max(static_cast<float>(rule.floor), 1e-3f * unit);
  }
};

// Pixels [first, last) as the shaders read them.
struct Band {
  std::vector<glm::vec4> signal, variance, surface;

  Band(const Layers& layers, const std::vector<double>& camera, const Scale& scale,
       std::size_t first, std::size_t last) {
    const auto white = static_cast<float>(layers.white);
    const auto samples =
        static_cast<float>(std::clamp<std::int64_t>(layers.samples, 1, most_sure_samples));
    const float most_variance = white * white / samples;
    for (std::size_t i = first; i < last; ++i) {
      const glm::vec3 units = scale(i);
      const glm::vec3 through = seen_through(layers, camera, i);
      const glm::vec3 shown = glm::min(layers.composite[i], glm::max(through, white));
      signal.emplace_back((shown - through) / units, layers.depth[i] > 0 ? 1 / layers.depth[i] : 0);
      variance.emplace_back(glm::min(layers.variance[i], most_variance) / (units * units), 0);
      surface.emplace_back(layers.normal[i], layers.mask[i]);
    }
  }
};

// What came back of pixels from `uploaded` on, of which [first, last) are to be kept.
struct Result {
  std::size_t uploaded = 0, first = 0, last = 0;
  std::vector<glm::vec4> signal, variance;
};

void keep(const Result& result, Layers& layers, const std::vector<double>& camera,
          const Scale& scale) {
  const auto white = static_cast<float>(layers.white);
  for (std::size_t i = result.first; i < result.last; ++i) {
    const glm::vec4& signal = result.signal[i - result.uploaded];
    const glm::vec4& variance = result.variance[i - result.uploaded];
    const glm::vec3 units = scale(i);
    const glm::vec3 denoised = seen_through(layers, camera, i) + units * glm::vec3(signal);
    const glm::vec3 left = units * units * variance.w * glm::vec3(variance);
    for (int c = 0; c < 3; ++c) {
      if (layers.composite[i][c] >= white && denoised[c] >= nearly_white * white) continue;
      layers.composite[i][c] = denoised[c];
      layers.variance[i][c] = left[c];
    }
  }
}

}  // namespace

Denoiser::Denoiser(Device& device, std::size_t most_pixels)
    : device_(device), most_pixels_(most_pixels) {
  using Type = vk::DescriptorType;
  set_layout_ = create_set_layout(device, gpu::DENOISE_BINDINGS, [](std::uint32_t binding) {
    return is_read_as_texels(binding) ? Type::eUniformTexelBuffer : Type::eStorageBuffer;
  });
  const vk::PushConstantRange constants(vk::ShaderStageFlagBits::eCompute, 0,
                                        sizeof(gpu::GpuDenoise));
  layout_ = vk::raii::PipelineLayout(device.vk(), {{}, *set_layout_, constants});
  const vk::DescriptorPoolSize sizes[] = {{Type::eUniformTexelBuffer, 2 * gpu::DENOISE_BINDINGS},
                                          {Type::eStorageBuffer, 2 * gpu::DENOISE_BINDINGS}};
  descriptors_ = vk::raii::DescriptorPool(
      device.vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 2, sizes});
  const vk::DescriptorSetLayout layouts[] = {*set_layout_, *set_layout_};
  sets_ = vk::raii::DescriptorSets(device.vk(), {*descriptors_, layouts});
  variance_pass_ = create_pipeline(device, denoise_variance_spv, layout_, {});
  level_pass_ = create_pipeline(device, denoise_spv, layout_, {});
}

void Denoiser::resize(std::size_t pixels) {
  if (pixels <= pixels_) return;
  pixels_ = 0;  // until all is there, whatever is thrown on the way
  const auto texels = [&] {
    return create_texel_buffer(device_, pixels * sizeof(gpu::vec4),
                               vk::Format::eR32G32B32A32Sfloat);
  };
  for (int side : {0, 1}) {
    signal_[side] = texels();
    variance_[side] = texels();
  }
  surface_ = texels();
  for (int side : {0, 1}) {
    const Buffer* buffers[gpu::DENOISE_BINDINGS];
    buffers[gpu::BINDING_DENOISE_SIGNAL] = &signal_[side];
    buffers[gpu::BINDING_DENOISE_VARIANCE] = &variance_[side];
    buffers[gpu::BINDING_DENOISE_SURFACE] = &surface_;
    buffers[gpu::BINDING_DENOISED_SIGNAL] = &signal_[1 - side];
    buffers[gpu::BINDING_DENOISED_VARIANCE] = &variance_[1 - side];
    for (std::uint32_t i = 0; i < gpu::DENOISE_BINDINGS; ++i)
      write_descriptor(device_, sets_[static_cast<std::size_t>(side)], i, *buffers[i],
                       is_read_as_texels(i));
  }
  pixels_ = pixels;
}

// Each pass goes to the other side, from 0: first the one for the variance.
constexpr int result_side = (1 + wavelet_levels) % 2;

void Denoiser::run(int width, int rows, bool single_sample) {
  gpu::GpuDenoise constants{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(rows), 0,
                            single_sample ? 1u : 0u};
  device_.submit([&](const vk::raii::CommandBuffer& commands) {
    std::size_t side = 0;
    const auto pass = [&](const Pipeline& pipeline) {
      commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipeline.pipeline);
      commands.bindDescriptorSets(vk::PipelineBindPoint::eCompute, *layout_, 0, *sets_[side], {});
      commands.pushConstants<gpu::GpuDenoise>(*layout_, vk::ShaderStageFlagBits::eCompute, 0,
                                              constants);
      commands.dispatch(work_groups(constants.width * constants.height), 1, 1);
      barrier(commands);
      side = 1 - side;
    };
    pass(variance_pass_);
    for (int level = 0; level < wavelet_levels; ++level) {
      constants.step = 1u << level;
      pass(level_pass_);
    }
  });
}

void Denoiser::denoise(Layers& layers, const std::vector<double>& camera,
                       const CompositeRule& rule) {
  const auto width = static_cast<std::size_t>(layers.width);
  const auto fitting = static_cast<int>(std::min<std::size_t>(
      most_pixels_ / width, static_cast<std::size_t>(layers.height) + 2 * reach));
  // At least as many as a band needs above it: those are then the band before's alone.
  const int band = std::max(fitting - 2 * reach, reach);
  const Scale scale{layers, camera, rule};
  Result before;
  for (int y = 0; y < layers.height; y += band) {
    const int top = std::max(y - reach, 0);
    const int end = std::min(y + band, layers.height);
    const int bottom = std::min(end + reach, layers.height);
    const std::size_t first = static_cast<std::size_t>(top) * width;
    const std::size_t last = static_cast<std::size_t>(bottom) * width;
    const Band input(layers, camera, scale, first, last);
    // Only now may the rows above change: this band was made of some of them.
    keep(before, layers, camera, scale);
    resize(last - first);
    upload_bytes(device_, signal_[0], std::as_bytes(std::span(input.signal)));
    upload_bytes(device_, variance_[0], std::as_bytes(std::span(input.variance)));
    upload_bytes(device_, surface_, std::as_bytes(std::span(input.surface)));
    run(layers.width, bottom - top, layers.samples < 2);
    before = {first, static_cast<std::size_t>(y) * width, static_cast<std::size_t>(end) * width,
              download<glm::vec4>(device_, signal_[result_side], last - first),
              download<glm::vec4>(device_, variance_[result_side], last - first)};
  }
  keep(before, layers, camera, scale);
  layers.denoised = true;
}

}  // namespace previz::render
