// The view of the benchmarks of things that move: a scene from 3 m above, in even light.
#pragma once

#include <memory>
#include <vector>

#include "daemon/core/render/renderer.hpp"

namespace previz::bench {

struct ViewFromAbove {
  ViewFromAbove(const std::shared_ptr<render::Device>& device, const scene::Scene& scene, int width,
                int height, set::Estimation estimation = {}) {
    ObserverCalibration calibration;
    calibration.intrinsics = {
        width, height, 1.0 * height, 1.0 * height, 0.5 * (width - 1), 0.5 * (height - 1)};
    estimation.max_depth = 4;
    renderer = std::make_unique<render::Renderer>(device, estimation, calibration);
    renderer->set_scene(scene);
    renderer->set_environment({4, std::vector<glm::vec3>(16, glm::vec3(0.5f))},
                              set::LightSampling::importance);
    frame.world_from_camera = {{1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {0, 0, 3, 1}};
  }

  std::unique_ptr<render::Renderer> renderer;
  render::FrameInput frame;
};

}  // namespace previz::bench
