// Runs pixels and layers that a test makes by hand through the renderer's steps after sampling.
#pragma once

#include <random>
#include <span>

#include "daemon/render/presenter.hpp"
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
  std::vector<render::Buffer> buffers;
  std::vector<std::pair<int, int>> rows;
  for (int row = 0; row < plate.height; row += tile_rows) {
    rows.emplace_back(row, std::min(tile_rows, plate.height - row));
    const auto tile = pixels.subspan(static_cast<std::size_t>(row) * plate.width,
                                     static_cast<std::size_t>(rows.back().second) * plate.width);
    render::upload_storage(*shared_device(), buffers.emplace_back(),
                           std::vector(tile.begin(), tile.end()));
  }
  const auto samples = static_cast<std::int64_t>(pixels.front().square_diff_high.w);
  render::ToPresent what{{}, plate.width, plate.height, plate, exposure, {}, samples, denoise};
  for (std::size_t i = 0; i < rows.size(); ++i)
    what.tiles.push_back({buffers[i], rows[i].first, rows[i].second});
  return render::Presenter(*shared_device(), response).present(what, denoiser);
}

// The denoiser's input, as shaders/composite.comp makes it.
struct DenoiserInput {
  std::vector<glm::vec4> signal, variance, surface;
};

// Makes the input of pixels [first, last). `camera` and `rule` are those of Denoiser::read().
inline DenoiserInput denoiser_input(const render::Layers& layers, const std::vector<double>& camera,
                                    const render::CompositeRule& rule, std::size_t first,
                                    std::size_t last) {
  DenoiserInput input;
  const auto white = static_cast<float>(layers.white);
  const float most_variance = render::most_sure_variance(white, layers.samples);
  for (std::size_t i = first; i < last; ++i) {
    glm::vec3 plate(0);
    if (!camera.empty()) plate = {camera[3 * i], camera[3 * i + 1], camera[3 * i + 2]};
    const bool multiplied = rule.kind != set::Composite::additive && layers.mask[i] == 0;
    const glm::vec3 unit = multiplied
                               ? plate + std::max(static_cast<float>(rule.floor), 1e-3f * white)
                               : glm::vec3(white);
    const glm::vec3 through = (1 - layers.mask[i]) * plate;
    const glm::vec3 shown = glm::min(layers.composite[i], glm::max(through, white));
    input.signal.emplace_back((shown - through) / unit,
                              layers.depth[i] > 0 ? 1 / layers.depth[i] : 0);
    input.variance.emplace_back(glm::min(layers.variance[i], most_variance) / (unit * unit), 0);
    input.surface.emplace_back(layers.normal[i], layers.mask[i]);
  }
  return input;
}

// Removes noise from the layers.
inline void denoise(render::Denoiser& denoiser, render::Layers& layers,
                    const std::vector<double>& camera = {},
                    const render::CompositeRule& rule = {}) {
  render::Device& device = *shared_device();
  const render::Layers raw = layers;
  const auto width = static_cast<std::size_t>(layers.width);
  for (const render::Denoiser::Band& band : denoiser.bands(layers.width, layers.height)) {
    const std::size_t top = static_cast<std::size_t>(band.top) * width;
    const std::size_t bottom = static_cast<std::size_t>(band.bottom) * width;
    const DenoiserInput input = denoiser_input(raw, camera, rule, top, bottom);
    denoiser.reserve(bottom - top);
    render::upload_bytes(device, denoiser.signal(), std::as_bytes(std::span(input.signal)));
    render::upload_bytes(device, denoiser.variance(), std::as_bytes(std::span(input.variance)));
    render::upload_bytes(device, denoiser.surface(), std::as_bytes(std::span(input.surface)));
    device.submit([&](const vk::raii::CommandBuffer& commands) {
      denoiser.record(commands, layers.width, band.bottom - band.top, layers.samples < 2);
    });
    denoiser.read(band, layers, camera, rule);
  }
}

}  // namespace previz::test
