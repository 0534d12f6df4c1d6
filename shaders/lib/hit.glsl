// What a ray meets.
#ifndef PREVIZ_HIT_GLSL
#define PREVIZ_HIT_GLSL

#include "shaders/lib/shared.h"

struct Hit {
  float t;            // in units of the ray's direction, as given
  vec2 barycentrics;  // weights of the primitive's second and third corner
  uint instance;      // index of Scene::instances
  uint primitive;     // index of Mesh::triangles
  uint presence;      // WORLD_* bits of the instance
};

// Hits of two instances count as being at the same place if they are closer than this share of the
// distances involved. The lower instance then wins, so that faces laid upon each other do not
// speckle.
const float TRACE_TIE = 9.5367432e-7;

// The triangle that a ray leaves, which it never meets, whatever rounding says: instance and
// primitive.
const uvec2 TRACE_FROM_NOWHERE = uvec2(0xffffffffu);

#endif
