#include "daemon/core/render/picture/views.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "daemon/core/render/picture/each_pixel.hpp"

namespace previz::render {
namespace {

// Returns the signal of a pixel's channel: 0..1, or radiance times exposure.
using Signal = std::function<double(std::size_t pixel, int channel)>;

double sample_of(double share, int bits) {
  const double white = static_cast<double>((1 << bits) - 1);
  return std::round(std::clamp(share, 0.0, 1.0) * white);
}

}  // namespace

const char* name_of(View view) {
  constexpr std::array names = {"composite", "mixed", "real",   "difference",
                                "mask",      "depth", "normal", "noise"};
  return names[static_cast<std::size_t>(view)];
}

Plate picture_of(View view, const Layers& layers, const lighting::Response& response,
                 double exposure) {
  const auto radiance = [&](const Sheet<glm::vec3>& layer, double gain, double offset) {
    return Signal([&layer, &response, exposure, gain, offset](std::size_t i, int c) -> double {
      return response.forward(offset + gain * exposure * static_cast<double>(layer[i][c]));
    });
  };
  const auto share = [&](std::function<double(std::size_t, int)> value) {
    return Signal([value = std::move(value), bits = response.bits()](std::size_t i, int c) {
      return sample_of(value(i, c), bits);
    });
  };
  const auto signal = [&]() -> Signal {
    switch (view) {
      case View::composite:
        return radiance(layers.composite, 1, 0);
      case View::mixed:
        return radiance(layers.mixed, 1, 0);
      case View::real:
        return radiance(layers.real, 1, 0);
      case View::difference:
        return radiance(layers.diff, 0.5, 0.18);
      case View::mask:
        return share([&](std::size_t i, int) { return layers.mask[i]; });
      case View::depth:
        return share([&](std::size_t i, int) {
          return layers.depth[i] > 0 ? 1 / (1 + layers.depth[i]) : 0.0f;
        });
      case View::normal:
        return share([&](std::size_t i, int c) {
          return layers.normal[i] == glm::vec3(0) ? 0.0f : 0.5f + 0.5f * layers.normal[i][c];
        });
      case View::noise:
        return share([&](std::size_t i, int c) {
          return 8 * exposure * std::sqrt(static_cast<double>(layers.variance[i][c]));
        });
    }
    return radiance(layers.composite, 1, 0);
  }();

  Plate picture{layers.width, layers.height, response.bits(),
                std::vector<std::uint16_t>(3 * layers.mask.size())};
  each_pixel(layers.mask.size(), [&](std::size_t i) {
    for (int c = 0; c < 3; ++c)
      picture.samples[3 * i + static_cast<std::size_t>(c)] =
          static_cast<std::uint16_t>(signal(i, c));
  });
  return picture;
}

}  // namespace previz::render
