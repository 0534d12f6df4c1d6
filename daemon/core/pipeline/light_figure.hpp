// Says how bright the model of what is real is, under the light of the set, beside the picture.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/render/picture/layers.hpp"
#include "drivers/plate.hpp"

namespace previz::pipeline {

// Light, exposure, colours and shape of the model are all in it, so that a factor near 1 says that
// they fit together, and another one does not say which of them is wrong.
struct LightFigure {
  glm::dvec3 ratio{1};  // model over picture, by channel: the median over tiles of pictures
  glm::dvec3 sigma{0};  // standard deviation of the ratio's logarithm
  std::size_t tiles = 0;
};

// A light that is farther off than a third of a stop, as shutters and aperture rings are, is wrong.
inline constexpr double light_off_stops = 1.0 / 3;

// Returns what is wrong with the light, in plain words; empty: it fits, as far as one can tell.
std::string light_remark(const LightFigure& figure);
// Returns the same for a display, if it is wrong: "1.1 1.6 1.9 times the picture: calibrate
// balance".
std::string light_notice(const LightFigure& figure);

// Compares the layer `real` with the plate in pixels that nothing virtual covers and that show the
// model, where no sample of the plate is black or clipped.
class LightComparison {
 public:
  // The layers and the plate, in the codes of `response`, have the same size. Where only the
  // difference was traced, nothing is compared.
  void add(const render::Layers& layers, const Plate& plate, const lighting::Response& response);

  // Returns nothing where too little of the pictures can be compared.
  std::optional<LightFigure> figure() const;

 private:
  std::vector<glm::dvec3> logs_;  // of the model over the picture, a tile each
};

}  // namespace previz::pipeline
