// Judges the light of a take by its rendered frames: how bright the model of what is real comes out
// beside the picture, and shadows that take more light than there is.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/lighting/response.hpp"
#include "daemon/pipeline/light_figure.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/render/gpu.hpp"
#include "daemon/scene/scene.hpp"

namespace previz::post {

class LightJudgement {
 public:
  // The take must outlive this. `scale` is that of the frames' pictures.
  LightJudgement(const pipeline::Take& take, double scale) : take_(take), scale_(scale) {}

  // Takes a frame with its layers. Only the first dozen are compared with their plates.
  void add(const pipeline::Shot& shot);

  std::optional<pipeline::LightFigure> figure() const { return comparison_.figure(); }
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

// Renders three frames that are spread over the take, small, and judges its light by them; frames
// without a pose or light are left out.
LightJudgement light_of_take(const pipeline::Take& take, const scene::Scene& scene,
                             const std::shared_ptr<render::Device>& device,
                             const std::stop_token& stop = {});

}  // namespace previz::post
