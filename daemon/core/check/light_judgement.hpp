// Judges the light of a take by its rendered frames: how bright the model of what is real comes out
// beside the picture, and shadows that take more light than there is.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/pipeline/light_figure.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::check {

class LightJudgement {
 public:
  // The take must outlive this. `scale` is that of the frames' pictures.
  LightJudgement(const pipeline::Take& take, double scale) : take_(take), scale_(scale) {}

  // Takes a frame with its layers. Only the first dozen are compared with their plates.
  void add(const pipeline::Shot& shot);

  // Returns what does not hold, in sentences of their own; empty: all is well.
  std::vector<std::string> doubts() const;

 private:
  const pipeline::Take& take_;
  const double scale_;
  std::optional<lighting::Response> response_;
  pipeline::LightComparison comparison_;
  std::size_t compared_ = 0;             // frames
  std::uint64_t frames_below_zero_ = 0;  // that have such pixels
  std::uint64_t most_below_zero_ = 0;    // pixels of a frame
};

// Renders three frames that are spread over the take, small; frames without a pose or light are
// left out.
std::optional<pipeline::LightFigure> light_of_take(const pipeline::Take& take,
                                                   const scene::Scene& scene,
                                                   const std::shared_ptr<render::Device>& device);

}  // namespace previz::check
