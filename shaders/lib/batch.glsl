// The batch says which part of the picture and which samples a dispatch works on.
#ifndef PREVIZ_BATCH_GLSL
#define PREVIZ_BATCH_GLSL

#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform Batch { GpuBatch batch; };

#endif
