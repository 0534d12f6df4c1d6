// The rays of a test or benchmark: two texels each, and what the dispatch is about.
#extension GL_EXT_samplerless_texture_functions : require
#include "shaders/lib/trace.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;
uniform textureBuffer rays;  // origin, t_min; direction, t_max
layout(push_constant) uniform Batch {
  uint count;
  uint worlds;
};
