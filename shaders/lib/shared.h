// Every structure and constant that crosses between C++ and the shaders, with its layout.
#ifndef PREVIZ_SHARED_H
#define PREVIZ_SHARED_H

#ifdef __cplusplus
#include <cstdint>
#include <glm/glm.hpp>
namespace previz::gpu {
using glm::mat3x4;
using glm::mat4;
using glm::uvec2;
using glm::uvec3;
using glm::uvec4;
using glm::vec2;
using glm::vec3;
using glm::vec4;
using uint = std::uint32_t;
#define PREVIZ_CONST inline constexpr
#else
#define PREVIZ_CONST const
#endif

// Presence bits of an instance, world bits of a path, ray mask.
PREVIZ_CONST uint WORLD_MIXED = 1u;
PREVIZ_CONST uint WORLD_REAL = 2u;
PREVIZ_CONST uint WORLD_BOTH = 3u;

// Scene buffers of set 0, read by lib/trace.glsl. All are texel buffers: on lavapipe they are 1.4
// to 1.7 times as fast as storage buffers.
//   BINDING_BVH_NODES      RGBA32UI, 5 texels a node; the top level first (its root at texel 0),
//                          then every mesh's nodes
//   BINDING_BVH_TRIANGLES  RGBA32F, 3 texels a triangle in leaf order: v0, v1 - v0, v2 - v0;
//                          v0.w holds the bits of the primitive's index in its mesh
//   BINDING_BVH_INSTANCES  RGBA32F, 4 texels an instance in top-level leaf order: the three rows of
//                          object_from_world (3x4), then the bits of (first node texel of the mesh,
//                          first triangle texel of the mesh, presence, index of the instance)
PREVIZ_CONST uint BINDING_BVH_NODES = 0u;
PREVIZ_CONST uint BINDING_BVH_TRIANGLES = 1u;
PREVIZ_CONST uint BINDING_BVH_INSTANCES = 2u;

PREVIZ_CONST uint TEXELS_PER_NODE = 5u;
PREVIZ_CONST uint TEXELS_PER_TRIANGLE = 3u;
PREVIZ_CONST uint TEXELS_PER_TRACE_INSTANCE = 4u;

#ifdef __cplusplus
}  // namespace previz::gpu
#endif
#endif
