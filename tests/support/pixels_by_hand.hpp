// Runs pixels and layers that a test makes by hand through the renderer's steps after sampling.
#pragma once

#include "daemon/core/render/passes/presenter.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test {

inline Plate random_plate(int width, int height, int bits) {
  Plate plate{width, height, bits, {}};
  std::mt19937 random(7);
  for (int i = 0; i < 3 * width * height; ++i)
    plate.samples.push_back(static_cast<std::uint16_t>(random() & ((1u << bits) - 1)));
  return plate;
}

// Makes layers of one row of pixels.
inline render::Layers layers_of(std::span<const gpu::GpuPixel> pixels, std::int64_t samples,
                                const render::PlateRadiance& plate = {},
                                const render::CompositeRule& rule = {}) {
  render::Layers layers = render::make_layers(static_cast<int>(pixels.size()), 1, samples);
  render::composite(layers, 0, pixels, plate, rule);
  return layers;
}

// Returns the picture of these pixels. `plate` must have the same size.
inline Plate present(std::span<const gpu::GpuPixel> pixels, const Plate& plate,
                     const lighting::Response& response, double exposure,
                     render::Denoiser& denoiser, bool denoise, int tile_rows) {
  const render::Purpose purpose{"a test", ""};
  std::vector<render::Buffer> buffers;
  std::vector<std::pair<int, int>> rows;
  for (int row = 0; row < plate.height; row += tile_rows) {
    rows.emplace_back(row, std::min(tile_rows, plate.height - row));
    const auto tile = pixels.subspan(static_cast<std::size_t>(row) * plate.width,
                                     static_cast<std::size_t>(rows.back().second) * plate.width);
    render::upload_storage(*shared_device(), purpose, buffers.emplace_back(),
                           std::vector(tile.begin(), tile.end()));
  }
  const auto samples = static_cast<std::int64_t>(pixels.front().square_high.w);
  render::Buffer codes;
  std::vector<std::uint16_t> padded = plate.samples;
  padded.resize((padded.size() + 2) / 2 * 2);
  render::upload_texels(*shared_device(), purpose, codes, padded, vk::Format::eR32Uint);
  const bool has_plate = !plate.samples.empty();
  const bool is_clipped =
      has_plate && *std::ranges::max_element(plate.samples) >= response.clipping().from;
  render::Buffer control;
  render::upload_storage(*shared_device(), purpose, control, std::vector{gpu::GpuControl{}});
  render::ToPresent what{{},         plate.width, plate.height, control, codes,  has_plate,
                         is_clipped, exposure,    {},           samples, denoise};
  for (std::size_t i = 0; i < rows.size(); ++i)
    what.tiles.push_back({buffers[i], rows[i].first, rows[i].second});
  return render::Presenter(*shared_device(), response).present(what, denoiser);
}

// The uncovered part of each pixel's change, which no layer has.
inline std::vector<glm::vec3> uncovered_of(std::span<const gpu::GpuPixel> pixels) {
  std::vector<glm::vec3> uncovered;
  for (const gpu::GpuPixel& p : pixels)
    uncovered.push_back(glm::vec3(p.uncovered_high + p.uncovered_low) /
                        (p.square_high.w + p.square_low.w));
  return uncovered;
}

inline bool is_caustic(const render::Layers& layers, std::size_t i) {
  bool is_one = false;
  for (int c = 0; c < 3; ++c)
    is_one |= layers.composite[i][c] - static_cast<float>(layers.white) >
              2 * std::sqrt(layers.variance[i][c]);
  return is_one && layers.samples > 1 && layers.mask[i] == 0;
}

// The denoiser's input, as shaders/composite.comp makes it. Where `uncovered` (uncovered_of) is
// empty, it is taken to be a partly covered pixel's share of the difference.
struct DenoiserInput {
  std::vector<glm::vec4> signal, variance, surface, uncovered, real;
};

// Makes the input of pixels [first, last).
inline DenoiserInput denoiser_input(const render::Layers& layers, std::size_t first,
                                    std::size_t last, std::span<const glm::vec3> uncovered = {}) {
  DenoiserInput input;
  const auto white = static_cast<float>(layers.white);
  const float most_variance = render::most_variance(white, layers.samples);
  for (std::size_t i = first; i < last; ++i) {
    const float mask = layers.mask[i];
    const glm::vec3 change = mask * layers.mixed[i] + (1 - mask) * layers.diff[i];
    input.signal.emplace_back(glm::min(change / white, gpu::DENOISE_MOST_WHITES),
                              layers.depth[i] > 0 ? 1 / layers.depth[i] : 0);
    input.variance.emplace_back(glm::min(layers.variance[i], most_variance) / (white * white), 0);
    input.surface.emplace_back(layers.normal[i],
                               is_caustic(layers, i) ? gpu::DENOISE_HIGHLIGHT : mask);
    const glm::vec3 own = uncovered.empty() ? (1 - mask) * layers.diff[i] : uncovered[i];
    input.uncovered.emplace_back(own / white, 0);
    input.real.emplace_back(layers.real[i] / white, 0);
  }
  return input;
}

// Removes noise from the layers. The change of the composite is taken from `mixed` and `diff`.
inline void denoise(render::Denoiser& denoiser, render::Layers& layers,
                    const render::PlateRadiance& plate = {}, const render::CompositeRule& rule = {},
                    std::span<const glm::vec3> uncovered = {}) {
  render::Device& device = *shared_device();
  const render::Layers raw = layers;
  const auto width = static_cast<std::size_t>(layers.width);
  for (const render::Denoiser::Band& band : denoiser.bands(layers.width, layers.height)) {
    const std::size_t top = static_cast<std::size_t>(band.top) * width;
    const std::size_t bottom = static_cast<std::size_t>(band.bottom) * width;
    const DenoiserInput input = denoiser_input(raw, top, bottom, uncovered);
    denoiser.reserve(bottom - top, true);
    const auto upload = [&](render::Buffer& buffer, const std::vector<glm::vec4>& texels) {
      render::upload_bytes(device, buffer, std::as_bytes(std::span(texels)));
    };
    upload(denoiser.signal(), input.signal);
    upload(denoiser.variance(), input.variance);
    upload(denoiser.surface(), input.surface);
    upload(denoiser.uncovered(), input.uncovered);
    upload(denoiser.real(), input.real);
    const std::vector<std::uint16_t> no_albedo(4 * (bottom - top), 0x3c00);  // halves of 1
    render::upload_bytes(device, denoiser.albedo(), std::as_bytes(std::span(no_albedo)));
    device.record([&](const vk::raii::CommandBuffer& commands) {
      denoiser.record(commands, layers.width, band.bottom - band.top, layers.samples < 2);
    });
    denoiser.read(band, layers, plate, rule);
  }
}

}  // namespace previz::test
