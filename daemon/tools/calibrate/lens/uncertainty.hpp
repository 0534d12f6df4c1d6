// Computes how far the projection of a calibrated lens may be off, all over its picture.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/tools/calibrate/lens/bundle.hpp"

namespace previz::calibrate {

struct UncertainPixel {
  glm::dvec2 pixel;
  double sigma_px = 0;  // standard deviation along the error's longest axis
};

// Returns the uncertainty of where far points are projected: the covariance of the lens's
// parameters propagated to the picture, without the part that a rotation of the whole camera
// absorbs (the rotation is found anew with every pose). After mrcal's "projection uncertainty" with
// an implied rotation (Kogan, https://mrcal.secretsauce.net/uncertainty.html). `rays` are unit
// vectors.
std::vector<UncertainPixel> projection_uncertainty(const BundleFit& fit,
                                                   const Projection& projection,
                                                   const std::vector<glm::dvec3>& rays);

}  // namespace previz::calibrate
