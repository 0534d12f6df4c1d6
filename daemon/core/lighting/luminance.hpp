// Computes the luminance of linear Rec. 709 radiance (ITU-R BT.709-6, item 3.2), in the units of
// the radiance.
#pragma once

#include <glm/vec3.hpp>

namespace previz::lighting {

inline double luminance(const glm::dvec3& radiance) {
  return 0.2126 * radiance.r + 0.7152 * radiance.g + 0.0722 * radiance.b;
}
inline double luminance(const glm::vec3& radiance) {
  return luminance(glm::dvec3(radiance));
}

}  // namespace previz::lighting
