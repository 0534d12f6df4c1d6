// The buffers of the passes that make a tree follow a mesh that deforms
// (daemon/core/scene/bvh_refit.hpp).
#ifndef PREVIZ_REFIT_GLSL
#define PREVIZ_REFIT_GLSL

#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;
layout(scalar, push_constant) uniform Refit { GpuRefit refit; };
layout(scalar) buffer Records { uvec4 bvh_texels[]; };  // BVH, to write; four of a record
layout(scalar) buffer RefitBoxes { GpuRefitBox refit_boxes[]; };  // of a record of the tree

uint first_texel(uint record) { return 4u * (refit.first_record + record); }

float half_area(vec3 low, vec3 high) {
  const vec3 size = high - low;
  return size.x * size.y + size.y * size.z + size.z * size.x;
}

#endif
