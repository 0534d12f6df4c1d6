#include "daemon/core/render/passes/presenter.hpp"

#include <algorithm>
#include <glm/common.hpp>
#include <utility>

#include "daemon/core/render/picture/blue_noise.hpp"
#include "shaders/composite.spv.h"
#include "shaders/enlarge.spv.h"
#include "shaders/present.spv.h"
#include "shaders/scan_out.spv.h"
#include "shaders/sides.spv.h"

namespace previz::render {
namespace {

// A pixel's samples are three 16-bit halves of words, and two pixels are written at once.
std::size_t words_of(std::size_t pixels) {
  return (pixels + 1) / 2 * 3;
}

// Returns whether the composite needs more than the change: the rule's gain, or what lies behind a
// clipped plate.
bool needs_companions(const ToPresent& what) {
  return what.is_clipped || what.rule.kind != set::Composite::additive;
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

gpu::GpuShow constants_of(const ToPresent& what, int bits, const lighting::Clipping& clipping) {
  gpu::GpuShow constants{};
  constants.has_plate = what.has_plate ? 1 : 0;
  constants.clip_from = clipping.from;
  constants.clip_at = clipping.at;
  constants.is_single = what.samples < 2 ? 1 : 0;
  constants.most = (1u << bits) - 1;
  constants.composite = composite_kind(what.rule.kind);
  constants.floor = static_cast<float>(what.rule.floor);
  constants.exposure = static_cast<float>(what.exposure);
  constants.white = static_cast<float>(1 / what.exposure);
  constants.most_variance = most_variance(constants.white, what.samples);
  constants.is_denoised = what.denoise ? 1 : 0;
  constants.is_dithered = what.dither ? 1 : 0;
  constants.width = static_cast<std::uint32_t>(what.width);
  constants.is_enlarged = what.whole ? 1 : 0;
  return constants;
}

}  // namespace

Presenter::Presenter(Device& device, const lighting::Response& response)
    : device_(device),
      bits_(response.bits()),
      clipping_(response.clipping()),
      tables_(device, response) {
  make_kernels({&composite_, &present_, &sides_, &enlarge_, &scan_out_}, device, passes());
  static const std::vector<float> pattern = blue_noise(gpu::DITHER_SIDE);
  const Purpose purpose{"the dither pattern", "close other programs"};
  upload_storage(device, purpose, thresholds_, pattern);
}

std::span<const Pass> Presenter::passes() {
  static constexpr Pass all[] = {{"composite", composite_spv},
                                 {"present", present_spv},
                                 {"sides", sides_spv},
                                 {"enlarge", enlarge_spv},
                                 {"scan_out", scan_out_spv}};
  return all;
}

void Presenter::reserve(std::size_t pixels) {
  if (pixels <= pixels_) return;
  pixels_ = 0;  // stays 0 if an allocation below throws
  const Purpose purpose{"the shown picture", "make the picture smaller"};
  composites_ = create_storage_buffer(device_, purpose, pixels * sizeof(gpu::vec4));
  highlights_ = create_storage_buffer(device_, purpose, pixels * sizeof(std::uint32_t));
  pixels_ = pixels;
}

// Makes room for so many pixels on their way out.
void Presenter::reserve_shown(std::size_t pixels) {
  if (pixels <= shown_pixels_) return;
  shown_pixels_ = 0;  // likewise
  const Purpose purpose{"the shown picture", "make the picture smaller"};
  picture_ = create_storage_buffer(device_, purpose, words_of(pixels) * sizeof(std::uint32_t));
  if (device_.card())
    screen_ = create_storage_buffer(device_, purpose, pixels * sizeof(std::uint32_t));
  shown_pixels_ = pixels;
}

// Makes room for what a rendering adds to a whole picture.
void Presenter::reserve_additions(const ToPresent& what) {
  const vk::DeviceSize size = sizeof(gpu::vec4) * static_cast<std::size_t>(what.width) *
                              static_cast<std::size_t>(what.height);
  if (!what.whole || size <= additions_.size) return;
  const Purpose purpose{"the shown picture", "make the picture smaller"};
  additions_ = create_storage_buffer(device_, purpose, size);
  sides_of_ = create_storage_buffer(device_, purpose, size);
}

// Composites the rows of the band that each tile holds.
void Presenter::composite(const ToPresent& what, const Denoiser::Band& band, gpu::GpuShow constants,
                          Denoiser& denoiser) {
  const auto width = static_cast<std::uint32_t>(what.width);
  for (const Wavefront::Sums& tile : what.tiles) {
    const int first = std::max(tile.first_row, band.top);
    const int last = std::min(tile.first_row + tile.rows, band.bottom);
    if (first >= last) continue;
    constants.count = static_cast<std::uint32_t>(last - first) * width;
    constants.in_tile = static_cast<std::uint32_t>(first - tile.first_row) * width;
    constants.in_band = static_cast<std::uint32_t>(first - band.top) * width;
    const Buffers buffers{{"pixels", &tile.pixels},
                          // Without photons any buffer will do: the shader does not read it.
                          {"pixel_caustics", tile.caustics ? tile.caustics : &tile.pixels},
                          {"caustics", &denoiser.caustic()},
                          {"plate_samples", &what.plate},
                          {"signal_of", &tables_.signal_of},
                          {"composites", &composites_},
                          {"highlights", &highlights_},
                          {"signals", &denoiser.signal()},
                          {"variances", &denoiser.variance()},
                          {"surfaces", &denoiser.surface()},
                          {"albedos", &denoiser.albedo()},
                          {"uncovered", &denoiser.uncovered()},
                          {"reals", &denoiser.real()}};
    device_.record([&](const vk::raii::CommandBuffer& commands) {
      composite_.dispatch({commands, constants, buffers}, constants.count);
    });
  }
}

// Adds the band to its past, and puts the result in its place.
void Presenter::accumulate(const ToPresent& what, const Denoiser::Band& band,
                           const gpu::GpuShow& constants, Denoiser& denoiser) {
  const Buffers buffers{{"plate_samples", &what.plate},      {"signal_of", &tables_.signal_of},
                        {"composites", &composites_},        {"signals", &denoiser.signal()},
                        {"variances", &denoiser.variance()}, {"surfaces", &denoiser.surface()},
                        {"albedos", &denoiser.albedo()},     {"uncovered", &denoiser.uncovered()},
                        {"reals", &denoiser.real()},         {"caustics", &denoiser.caustic()}};
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    what.history->record(commands, constants, what.width, band, buffers);
  });
}

// Composites the band and adds it to its past. Returns the constants for the whole band.
gpu::GpuShow Presenter::start(const ToPresent& what, const Denoiser::Band& band,
                              Denoiser& denoiser) {
  const auto width = static_cast<std::size_t>(what.width);
  const std::size_t pixels = static_cast<std::size_t>(band.bottom - band.top) * width;
  const bool has_caustics = what.tiles.front().caustics;
  denoiser.reserve(pixels, what.denoise && needs_companions(what), has_caustics);
  reserve(pixels);
  reserve_shown(what.whole ? 1 : pixels);
  gpu::GpuShow constants = constants_of(what, bits_, clipping_);
  constants.in_picture = static_cast<std::uint32_t>(static_cast<std::size_t>(band.top) * width);
  constants.has_caustics = has_caustics ? 1 : 0;
  composite(what, band, constants, denoiser);
  if (what.history) accumulate(what, band, constants, denoiser);
  return constants;
}

void Presenter::add_to_history(const ToPresent& what, Denoiser& denoiser) {
  for (const Denoiser::Band& band : denoiser.bands(what.width, what.height))
    start(what, band, denoiser);
}

void Presenter::read(const Denoiser::Band& band, Layers& layers) const {
  const auto width = static_cast<std::size_t>(layers.width);
  const std::size_t top = static_cast<std::size_t>(band.top) * width;
  const std::size_t first = static_cast<std::size_t>(band.first) * width;
  const std::size_t last = static_cast<std::size_t>(band.last) * width;
  const auto composites = download<glm::vec4>(device_, composites_, last - top);
  for (std::size_t i = first; i < last; ++i) {
    layers.composite[i] = glm::max(glm::vec3(composites[i - top]), 0.0f);
    layers.mask[i] = composites[i - top].w;
  }
}

Plate Presenter::present(const ToPresent& what, Denoiser& denoiser,
                         const std::function<void(const Denoiser::Band&)>& after_band) {
  const int width = what.shown_width(), height = what.shown_height();
  Plate picture{width, height, bits_,
                std::vector<std::uint16_t>(std::size_t{3} * static_cast<std::size_t>(width) *
                                           static_cast<std::size_t>(height))};
  Downloads down;
  present_later(what, denoiser, {.down = down, .plate = &picture, .on_card = {}}, after_band);
  down.finish();
  return picture;
}

// Copies the rows into an image that a display reads as well. Whoever holds the picture knows that
// its last reader is done; what was in it is forgotten with the first rows.
void Presenter::scan_out(int width, const Rows& shown, vk::Image image) {
  const auto columns = static_cast<std::uint32_t>(width);
  const auto rows = static_cast<std::uint32_t>(shown.last - shown.first);
  const gpu::GpuScanOut constants{columns * rows, bits_ > 8 ? 1u : 0u};
  const Buffers buffers{{"picture", &picture_}, {"screen", &screen_}};
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    scan_out_.dispatch({commands, constants, buffers}, constants.count);
    using Layout = vk::ImageLayout;
    using Stage = vk::PipelineStageFlagBits2;
    const vk::ImageSubresourceRange whole(vk::ImageAspectFlagBits::eColor, 0, 1, 0, 1);
    vk::ImageMemoryBarrier2 order(Stage::eCopy, vk::AccessFlagBits2::eTransferWrite, Stage::eCopy,
                                  vk::AccessFlagBits2::eTransferWrite, Layout::eUndefined,
                                  Layout::eGeneral, VK_QUEUE_FAMILY_IGNORED,
                                  VK_QUEUE_FAMILY_IGNORED, image, whole);
    if (shown.first == 0) commands.pipelineBarrier2(vk::DependencyInfo({}, {}, {}, order));
    device_.clock().start(commands, "copy to the screen's memory");
    commands.copyBufferToImage(
        *screen_.parts->buffer, image, Layout::eGeneral,
        vk::BufferImageCopy(0, 0, 0, {vk::ImageAspectFlagBits::eColor, 0, 0, 1},
                            {0, shown.first, 0}, {columns, rows, 1}));
    device_.clock().stop(commands);
    if (shown.are_last) {
      order.oldLayout = Layout::eGeneral;
      order.srcQueueFamilyIndex = device_.queue_family();
      order.dstQueueFamilyIndex = VK_QUEUE_FAMILY_EXTERNAL;
      order.dstStageMask = Stage::eNone;
      order.dstAccessMask = {};
      commands.pipelineBarrier2(vk::DependencyInfo({}, {}, {}, order));
    }
    device_.submissions().barrier(commands);
  });
}

void Presenter::present_later(const ToPresent& what, Denoiser& denoiser, const Destination& to,
                              const std::function<void(const Denoiser::Band&)>& after_band) {
  const auto width = static_cast<std::size_t>(what.width);
  reserve_additions(what);
  for (const Denoiser::Band& band : denoiser.bands(what.width, what.height)) {
    const std::size_t top = static_cast<std::size_t>(band.top) * width;
    const std::size_t first = static_cast<std::size_t>(band.first) * width;
    const std::size_t count = static_cast<std::size_t>(band.last - band.first) * width;
    gpu::GpuShow constants = start(what, band, denoiser);
    if (what.denoise) constants.has_caustics = 0;  // it was added to what is denoised
    constants.count = static_cast<std::uint32_t>(count);
    constants.in_band = static_cast<std::uint32_t>(first - top);
    const Buffers buffers{
        {"plate_samples", &what.plate},
        {"signal_of", &tables_.signal_of},
        {"least_of", &tables_.least_of},
        {"codes_near", &tables_.codes_near},
        {"thresholds", &thresholds_},
        {"caustics", &denoiser.caustic()},
        {"composites", &composites_},
        {"highlights", &highlights_},
        {"uncovered", &denoiser.denoised_uncovered()},
        {"reals", &denoiser.denoised_real()},
        {"control", &what.control},
        {"signals", what.denoise ? &denoiser.denoised_signal() : &denoiser.signal()},
        {"picture", &picture_},
        {"additions", what.whole ? &additions_ : &composites_}};
    device_.record([&](const vk::raii::CommandBuffer& commands) {
      if (what.denoise)
        denoiser.record(commands, what.width, band.bottom - band.top, what.samples < 2,
                        what.history != nullptr);
      present_.dispatch({commands, constants, buffers}, (constants.count + 1) / 2);
    });
    if (!what.whole) hand_over(what.width, {band.first, band.last, band.last == what.height}, to);
    if (what.denoise && after_band) after_band(band);
  }
  if (what.whole) enlarge(what, to);
}

// Sends the rows of the picture that is in `picture_` on their way.
void Presenter::hand_over(int width, const Rows& rows, const Destination& to) {
  const std::size_t first = static_cast<std::size_t>(rows.first) * static_cast<std::size_t>(width);
  const std::size_t last = static_cast<std::size_t>(rows.last) * static_cast<std::size_t>(width);
  if (to.plate)
    to.down.add(device_, picture_,
                std::as_writable_bytes(
                    std::span(to.plate->samples).subspan(3 * first, 3 * (last - first))));
  if (to.on_card) scan_out(width, rows, to.on_card);
}

// Puts what the rendering adds onto the camera's whole picture, as many rows at a time as a band
// has pixels.
void Presenter::enlarge(const ToPresent& what, const Destination& to) {
  const int width = what.whole_width, height = what.whole_height;
  const int at_once = std::clamp(static_cast<int>(most_band_pixels) / width, 1, height);
  reserve_shown(static_cast<std::size_t>(at_once) * static_cast<std::size_t>(width));
  gpu::GpuEnlarge constants{};
  constants.width = static_cast<std::uint32_t>(width);
  constants.from_width = static_cast<std::uint32_t>(what.width);
  constants.from_height = static_cast<std::uint32_t>(what.height);
  constants.most = (1u << bits_) - 1;
  constants.is_dithered = what.dither ? 1 : 0;
  constants.sharpness = static_cast<float>(width) / static_cast<float>(what.width);
  constants.step = {static_cast<float>(what.width) / static_cast<float>(width),
                    static_cast<float>(what.height) / static_cast<float>(height)};
  const Buffers buffers{{"plate_samples", what.whole},   {"signal_of", &tables_.signal_of},
                        {"least_of", &tables_.least_of}, {"codes_near", &tables_.codes_near},
                        {"thresholds", &thresholds_},    {"sides", &sides_of_},
                        {"picture", &picture_}};
  const std::uint32_t small = constants.from_width * constants.from_height;
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    sides_.dispatch(
        {commands,
         constants,
         {{"plate_samples", &what.plate}, {"additions", &additions_}, {"sides", &sides_of_}}},
        small);
  });
  for (int first = 0; first < height; first += at_once) {
    const int last = std::min(first + at_once, height);
    constants.first = static_cast<std::uint32_t>(first) * constants.width;
    constants.count = static_cast<std::uint32_t>(last - first) * constants.width;
    device_.record([&](const vk::raii::CommandBuffer& commands) {
      enlarge_.dispatch({commands, constants, buffers}, (constants.count + 1) / 2);
    });
    hand_over(width, {first, last, last == height}, to);
  }
}

}  // namespace previz::render
