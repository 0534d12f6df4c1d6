#include "daemon/render/presenter.hpp"

#include <algorithm>
#include <utility>

#include "shaders/composite.spv.h"
#include "shaders/present.spv.h"

namespace previz::render {
namespace {

// A pixel's samples are three halves of a word; two pixels are written at once.
std::size_t words_of(std::size_t pixels) {
  return (pixels + 1) / 2 * 3;
}

std::uint32_t composite_kind(set::Composite composite) {
  switch (composite) {
    case set::Composite::additive:
      return gpu::COMPOSITE_ADDITIVE;
    case set::Composite::ratio:
      return gpu::COMPOSITE_RATIO;
    case set::Composite::hybrid:
      return gpu::COMPOSITE_HYBRID;
  }
  return gpu::COMPOSITE_ADDITIVE;
}

gpu::GpuShow constants_of(const ToPresent& what, int bits) {
  gpu::GpuShow constants{};
  constants.has_plate = what.plate.samples.empty() ? 0 : 1;
  constants.most = (1u << bits) - 1;
  constants.composite = composite_kind(what.rule.kind);
  constants.floor = static_cast<float>(what.rule.floor);
  constants.exposure = static_cast<float>(what.exposure);
  constants.white = static_cast<float>(1 / what.exposure);
  constants.most_variance = most_sure_variance(constants.white, what.samples);
  constants.is_denoised = what.denoise ? 1 : 0;
  return constants;
}

}  // namespace

Presenter::Presenter(Device& device, const lighting::Response& response)
    : device_(device), bits_(response.bits()) {
  using Type = vk::DescriptorType;
  set_layout_ = create_set_layout(device, gpu::SHOW_BINDINGS,
                                  [](std::uint32_t) { return Type::eStorageBuffer; });
  const vk::PushConstantRange constants(vk::ShaderStageFlagBits::eCompute, 0, sizeof(gpu::GpuShow));
  layout_ = vk::raii::PipelineLayout(device.vk(), {{}, *set_layout_, constants});
  const vk::DescriptorPoolSize size(Type::eStorageBuffer, gpu::SHOW_BINDINGS);
  descriptors_ = vk::raii::DescriptorPool(
      device.vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, size});
  const vk::DescriptorSetLayout raw = *set_layout_;
  set_ = std::move(vk::raii::DescriptorSets(device.vk(), {*descriptors_, raw}).front());
  composite_ = create_pipeline(device, composite_spv, layout_, {});
  present_ = create_pipeline(device, present_spv, layout_, {});

  const std::vector<double>& inverse = response.inverse();
  upload_storage(device, signal_of_, std::vector<float>(inverse.begin(), inverse.end()));
  std::vector<float> least;
  for (std::size_t code = 0; code < inverse.size(); ++code)
    least.push_back(static_cast<float>(response.least_signal(static_cast<std::uint16_t>(code))));
  upload_storage(device, least_of_, least);
}

void Presenter::reserve(std::size_t pixels) {
  if (pixels <= pixels_) return;
  pixels_ = 0;  // until all is there, whatever is thrown on the way
  composites_ = create_storage_buffer(device_, pixels * sizeof(gpu::vec4));
  plate_ = create_storage_buffer(device_, words_of(pixels) * sizeof(std::uint32_t));
  picture_ = create_storage_buffer(device_, words_of(pixels) * sizeof(std::uint32_t));
  pixels_ = pixels;
}

void Presenter::bind(Denoiser& denoiser, bool denoise) {
  const std::pair<std::uint32_t, const Buffer*> buffers[] = {
      {gpu::BINDING_SHOW_PLATE, &plate_},
      {gpu::BINDING_SHOW_SIGNAL_OF, &signal_of_},
      {gpu::BINDING_SHOW_LEAST_OF, &least_of_},
      {gpu::BINDING_SHOW_COMPOSITE, &composites_},
      {gpu::BINDING_SHOW_SIGNAL, &denoiser.signal()},
      {gpu::BINDING_SHOW_VARIANCE, &denoiser.variance()},
      {gpu::BINDING_SHOW_SURFACE, &denoiser.surface()},
      {gpu::BINDING_SHOW_DENOISED, denoise ? &denoiser.denoised_signal() : &denoiser.signal()},
      {gpu::BINDING_SHOW_PICTURE, &picture_}};
  for (const auto& [binding, buffer] : buffers)
    write_descriptor(device_, set_, binding, *buffer, false);
}

void Presenter::record(const vk::raii::CommandBuffer& commands, const Pipeline& pipeline,
                       const gpu::GpuShow& constants, std::uint32_t invocations) const {
  commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipeline.pipeline);
  commands.bindDescriptorSets(vk::PipelineBindPoint::eCompute, *layout_, 0, *set_, {});
  commands.pushConstants<gpu::GpuShow>(*layout_, vk::ShaderStageFlagBits::eCompute, 0, constants);
  commands.dispatch(work_groups(invocations), 1, 1);
  barrier(commands);
}

// From each tile the rows that the band has of it.
void Presenter::composite(const ToPresent& what, const Denoiser::Band& band,
                          gpu::GpuShow constants) {
  const auto width = static_cast<std::uint32_t>(what.width);
  for (const Wavefront::Sums& tile : what.tiles) {
    const int first = std::max(tile.first_row, band.top);
    const int last = std::min(tile.first_row + tile.rows, band.bottom);
    if (first >= last) continue;
    constants.count = static_cast<std::uint32_t>(last - first) * width;
    constants.in_tile = static_cast<std::uint32_t>(first - tile.first_row) * width;
    constants.in_band = static_cast<std::uint32_t>(first - band.top) * width;
    write_descriptor(device_, set_, gpu::BINDING_SHOW_PIXELS, tile.pixels, false);
    device_.submit([&](const vk::raii::CommandBuffer& commands) {
      record(commands, composite_, constants, constants.count);
    });
  }
}

Plate Presenter::present(const ToPresent& what, Denoiser& denoiser,
                         const std::function<void(const Denoiser::Band&)>& after_band) {
  const auto width = static_cast<std::size_t>(what.width);
  Plate picture{what.width, what.height, bits_,
                std::vector<std::uint16_t>(3 * width * static_cast<std::size_t>(what.height))};
  for (const Denoiser::Band& band : denoiser.bands(what.width, what.height)) {
    const std::size_t top = static_cast<std::size_t>(band.top) * width;
    const std::size_t first = static_cast<std::size_t>(band.first) * width;
    const std::size_t count = static_cast<std::size_t>(band.last - band.first) * width;
    const std::size_t pixels = static_cast<std::size_t>(band.bottom - band.top) * width;
    denoiser.reserve(pixels);
    reserve(pixels);
    bind(denoiser, what.denoise);
    gpu::GpuShow constants = constants_of(what, bits_);
    if (constants.has_plate != 0)
      upload_bytes(device_, plate_,
                   std::as_bytes(std::span(what.plate.samples).subspan(3 * top, 3 * pixels)));
    composite(what, band, constants);
    constants.count = static_cast<std::uint32_t>(count);
    constants.in_band = static_cast<std::uint32_t>(first - top);
    device_.submit([&](const vk::raii::CommandBuffer& commands) {
      if (what.denoise)
        denoiser.record(commands, what.width, band.bottom - band.top, what.samples < 2);
      record(commands, present_, constants, (constants.count + 1) / 2);
    });
    download_bytes(
        device_, picture_,
        std::as_writable_bytes(std::span(picture.samples).subspan(3 * first, 3 * count)));
    if (what.denoise && after_band) after_band(band);
  }
  return picture;
}

}  // namespace previz::render
