#include "daemon/render/denoiser.hpp"

#include <algorithm>
#include <cmath>

#include "shaders/denoise.spv.h"
#include "shaders/denoise_variance.spv.h"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// Levels of the transform: steps of 1, 2, 4 and 8 pixels.
constexpr int levels = 4;
// Rows above and below that a row's result depends on: two steps of every level, the neighbours
// that give a slope, and those that give the variance.
constexpr int reach = 2 * ((1 << levels) - 1) + 1 + static_cast<int>(gpu::DENOISE_VARIANCE_REACH);

// Share of the sensor's white that is left of a pixel which is no outlier.
constexpr double nearly_white = 0.95;

bool is_texel_buffer(std::uint32_t binding) {
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

bool is_white(const glm::vec3& radiance, double share_of_white, const Layers& layers) {
  return static_cast<double>(std::max({radiance.r, radiance.g, radiance.b})) >=
         share_of_white * layers.white;
}

// Pixels [first, last) as the shaders read them.
struct Band {
  std::vector<glm::vec4> signal, variance, surface;

  Band(const Layers& layers, const std::vector<double>& camera, std::size_t first,
       std::size_t last) {
    const auto white = static_cast<float>(layers.white);
    const float unit = unit_of(layers);
    const float most_variance =
        white * white / static_cast<float>(std::max<std::int64_t>(layers.samples, 1));
    for (std::size_t i = first; i < last; ++i) {
      const glm::vec3 through = seen_through(layers, camera, i);
      const glm::vec3 shown = glm::min(layers.composite[i], glm::max(through, white));
      signal.emplace_back((shown - through) / unit, layers.depth[i] > 0 ? 1 / layers.depth[i] : 0);
      variance.emplace_back(glm::min(layers.variance[i], most_variance) / (unit * unit), 0);
      surface.emplace_back(layers.normal[i], layers.mask[i]);
    }
  }
};

}  // namespace

Denoiser::Denoiser(Device& device, std::size_t most_pixels)
    : device_(device), most_pixels_(most_pixels) {
  using Type = vk::DescriptorType;
  set_layout_ = create_set_layout(device, gpu::DENOISE_BINDINGS, [](std::uint32_t binding) {
    return is_texel_buffer(binding) ? Type::eUniformTexelBuffer : Type::eStorageBuffer;
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
  pixels_ = pixels;
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
                       is_texel_buffer(i));
  }
}

// Each pass goes to the other side, from 0: first the one for the variance.
constexpr int result_side = (1 + levels) % 2;

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
    for (int level = 0; level < levels; ++level) {
      constants.step = 1u << level;
      pass(level_pass_);
    }
  });
}

void Denoiser::denoise(Layers& layers, const std::vector<double>& camera) {
  const auto width = static_cast<std::size_t>(layers.width);
  const auto fitting = static_cast<int>(std::min<std::size_t>(
      most_pixels_ / width, static_cast<std::size_t>(layers.height) + 2 * reach));
  const int band = std::max(fitting - 2 * reach, 1);
  const float unit = unit_of(layers);
  std::vector<glm::vec3> composite = layers.composite;
  std::vector<glm::vec3> variance = layers.variance;
  for (int y = 0; y < layers.height; y += band) {
    const int top = std::max(y - reach, 0);
    const int end = std::min(y + band, layers.height);
    const int bottom = std::min(end + reach, layers.height);
    const std::size_t first = static_cast<std::size_t>(top) * width;
    const std::size_t last = static_cast<std::size_t>(bottom) * width;
    const Band input(layers, camera, first, last);
    resize(last - first);
    upload_bytes(device_, signal_[0], std::as_bytes(std::span(input.signal)));
    upload_bytes(device_, variance_[0], std::as_bytes(std::span(input.variance)));
    upload_bytes(device_, surface_, std::as_bytes(std::span(input.surface)));
    run(layers.width, bottom - top, layers.samples < 2);
    const auto signal = download<glm::vec4>(device_, signal_[result_side], last - first);
    const auto left = download<glm::vec4>(device_, variance_[result_side], last - first);
    for (std::size_t i = static_cast<std::size_t>(y) * width;
         i < static_cast<std::size_t>(end) * width; ++i) {
      const glm::vec3 denoised =
          seen_through(layers, camera, i) + unit * glm::vec3(signal[i - first]);
      if (is_white(composite[i], 1, layers) && is_white(denoised, nearly_white, layers)) continue;
      composite[i] = denoised;
      variance[i] = unit * unit * left[i - first].w * glm::vec3(left[i - first]);
    }
  }
  layers.composite = std::move(composite);
  layers.variance = std::move(variance);
}

}  // namespace previz::render
