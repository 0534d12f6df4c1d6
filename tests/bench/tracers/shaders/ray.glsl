// The rays of a test or benchmark, two elements each, and what the dispatch is about.
#include "shaders/lib/fetch.glsl"
#include "shaders/lib/trace.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;
PREVIZ_FETCHED(vec4, rays)  // origin, t_min; direction, t_max
layout(push_constant) uniform Batch {
  uint count;
  uint worlds;
};
