// A shot of a few grey pixels, for tests of what becomes of its files.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/core/pipeline/shot.hpp"
#include "drivers/plate.hpp"

namespace previz::test {

// Returns a whole shot of 8x6 pixels and 16 samples, without a pose or light of its own.
inline pipeline::Shot small_shot(std::uint64_t index) {
  constexpr int width = 8, height = 6;
  pipeline::Shot shot;
  shot.index = index;
  auto frame = std::make_shared<Frame>();
  frame->timestamp_ns = 1'000'000'000 + 40'000'000 * static_cast<std::int64_t>(index);
  frame->exposure = 1.1;
  shot.frame = frame;
  shot.light = std::make_shared<pipeline::Light>();
  shot.picture = std::make_shared<const Plate>(
      Plate{width, height, 8, std::vector<std::uint16_t>(3 * width * height, 99)});
  render::Layers layers;
  layers.width = width;
  layers.height = height;
  layers.samples = 16;
  for (auto* layer : {&layers.composite, &layers.mixed, &layers.real, &layers.diff, &layers.normal,
                      &layers.variance})
    layer->resize(width * height, glm::vec3(0.5f));
  layers.mask.resize(width * height);
  layers.depth.resize(width * height);
  shot.layers = std::make_shared<const render::Layers>(layers);
  shot.whole = true;
  return shot;
}

}  // namespace previz::test
