// Puts what a small rendering adds onto the camera's whole picture, in double precision
// (shaders/README.md, "A smaller rendering"); shaders/enlarge.comp does so for the shown picture.
#pragma once

#include <functional>
#include <glm/vec3.hpp>

#include "daemon/core/render/picture/layers.hpp"
#include "drivers/plate.hpp"

namespace previz::render {

// What a rendering adds to its small plate, row-major.
struct Additions {
  int width = 0, height = 0;
  Sheet<glm::vec3> light;  // composite - (1 - mask) * plate, in any linear unit
  Sheet<float> mask;       // the share of the pixel that something virtual covers
};

// Returns what the layers add to the plate that they were made with, in radiance times `scale`, the
// unit in which `light_of` says what light a sample of the plate stands for.
Additions additions_of(const Layers& layers, const Plate& plate,
                       const std::function<float(std::uint16_t)>& light_of, double scale);

// Returns the composite at the size of the whole picture, in the unit of the additions: the plate
// where no small pixel around adds anything. `small` is the plate that they are for.
Sheet<glm::vec3> enlarged(const Additions& additions, const Plate& small, const Plate& whole,
                          const std::function<float(std::uint16_t)>& light_of);

}  // namespace previz::render
