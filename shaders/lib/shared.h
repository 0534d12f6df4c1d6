// Structures and constants of ray tracing that cross between C++ and the shaders, with their
// layout. Those of the renderer are in render_shared.h.
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

// The worlds, as bits: the presence of an instance, the worlds of a path, the mask of a ray.
PREVIZ_CONST uint WORLD_MIXED = 1u;
PREVIZ_CONST uint WORLD_REAL = 2u;
PREVIZ_CONST uint WORLD_BOTH = 3u;

// Every pass has this many invocations in a work group.
PREVIZ_CONST uint WORKGROUP_SIZE = 64u;

// Bits of specialisation constant 1: what the device is (lib/device.glsl).
PREVIZ_CONST uint DEVICE_IS_CARD = 1u;
PREVIZ_CONST uint DEVICE_LANES_MEET = 2u;
PREVIZ_CONST uint DEVICE_READS_STORAGE = 4u;  // lib/fetch.glsl

// The scene as lib/trace.glsl reads it is one buffer of texels of four words, made by
// daemon/core/scene/bvh.hpp. It consists of records of four texels, one cache line, in blocks of eight;
// the children of a node are one block. Record 0 is the space in which a ray starts: that of the
// top level, or of the only instance.
//
//   any      Texel 0: z, bits 0..7: the kind, RECORD_*.
//   nothing  All zero: an empty slot. Meeting it has no effect.
//   node     Texel 0: x, y, z: origin << 8 | biased exponent, the quantisation of each axis (the
//            origin is a signed integer in grid space); w: the children's block, counted from the
//            start of the tree. Texels 1, 2, 3 for x, y, z: low planes of children 0..3, of 4..7,
//            high planes of 0..3, of 4..7, a byte each from the low byte up;
//            plane = origin + byte * 2^(exponent - 127). Bits 0, 1, 2 of a child's slot say that
//            it lies towards +x, +y, +z. An empty slot has an inverted box.
//   pair     Texel 0: x, y: primitive << 8 | RECORD_FILL + rotation, of two triangles. Texels 1..3:
//            floats v0, v1, v2, v3 in grid space. The triangles are (v0, v1, v2) and (v0, v2, v3),
//            each its primitive's corners turned left `rotation` times. v3 = v2: only the first.
//   space    Texel 0: x: the block where its tree starts, the root in slot 0, << 8 | RECORD_FILL;
//            y: presence << 8 | RECORD_FILL; w: index of the instance. Texels 1..3: the rows of
//            grid_from_world.
//
// On a CPU device every record is tested as a node and as a pair, whatever it is. RECORD_FILL
// and the numbers of the kinds make what is no node's exponent a harmless one: with denormal
// numbers there, lavapipe traced at a third of the speed.
PREVIZ_CONST uint RECORD_NOTHING = 0u;
PREVIZ_CONST uint RECORD_SPACE = 125u;
PREVIZ_CONST uint RECORD_PAIR = 126u;
PREVIZ_CONST uint RECORD_NODE = 127u;  // and above: the biased exponent of a node's z cell
PREVIZ_CONST uint RECORD_FILL = 124u;  // a multiple of four

// The builders make no more levels of nodes than these; their sum bounds the traversal's stack.
PREVIZ_CONST uint TOP_BVH_DEPTH = 8u;
PREVIZ_CONST uint MESH_BVH_DEPTH = 16u;

#ifdef __cplusplus
}  // namespace previz::gpu
#endif
#endif
