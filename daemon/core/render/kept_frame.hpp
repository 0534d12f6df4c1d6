// A frame that was rendered, with all that its picture is made of, in the computer's memory.
#pragma once

#include <cstdint>

#include "daemon/core/render/frame_input.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/render/world/gpu_scene.hpp"
#include "daemon/core/render/world/light_change.hpp"

namespace previz::render {

struct KeptFrame {
  int width = 0, height = 0;
  FrameInput frame;
  std::int64_t samples = 0;     // the largest number that a pixel has; 1 or more
  std::uint32_t features = 0;   // FEATURE_* bits of the pipelines
  GpuScene::Standing standing;  // of the scene
  LightCells light;             // of the environment
  PixelSums sums;
};

}  // namespace previz::render
