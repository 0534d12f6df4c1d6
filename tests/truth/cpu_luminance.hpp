// Luminance of linear Rec. 709 radiance (ITU-R BT.709-6, item 3.2). The tracer's own, as all of it
// is, so that it shares no mistake with the renderer.
#pragma once

#include <glm/vec3.hpp>

namespace previz::truth {

inline double luminance(const glm::dvec3& radiance) {
  return 0.2126 * radiance.x + 0.7152 * radiance.y + 0.0722 * radiance.z;
}

}  // namespace previz::truth
