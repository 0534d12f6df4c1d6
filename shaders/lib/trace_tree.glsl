// Closest hits and shadow rays through the two-level tree of daemon/core/scene/bvh.hpp, in compute.
//
// The loop visits one record per turn, whatever its kind. On a CPU device, which gains nothing from
// branches, all lanes of a subgroup test its eight boxes and its two triangles side by side; on a card
// each lane makes the test that its record is for. Internal to lib/trace.glsl.
#ifndef PREVIZ_TRACE_TREE_GLSL
#define PREVIZ_TRACE_TREE_GLSL

#include "shaders/lib/fetch.glsl"
#include "shaders/lib/hit.glsl"

PREVIZ_FETCHED(uvec4, bvh)

// Each level of nodes leaves at most one group of children on the stack, and so does entering an
// instance.
const uint TRACE_STACK_SIZE = TOP_BVH_DEPTH + MESH_BVH_DEPTH;

// The stack of groups: block of children << 8 | children still to visit. On a card its lower levels are
// in the memory that a work group shares: an invocation's own array would take that many registers.
// Only deep trees use the others, which are in an array that is too large for registers. On a CPU
// device all are in that array, which its cache holds.
const uint SHARED_LEVELS = 8u;
const uint OWN_LEVELS = max(TRACE_STACK_SIZE + 1u, 65u);
uint own_stack[OWN_LEVELS];
shared uint shared_stack[SHARED_LEVELS * WORKGROUP_SIZE];

uint shared_level(uint level) { return level * WORKGROUP_SIZE + gl_LocalInvocationIndex; }

void trace_keep(uint level, uint group) {
  if (on_card() && level < SHARED_LEVELS) shared_stack[shared_level(level)] = group;
  else own_stack[level] = group;
}

uint trace_kept(uint level) {
  if (on_card() && level < SHARED_LEVELS) return shared_stack[shared_level(level)];
  return own_stack[level];
}

// Rounding may move a ray sideways by this share of the largest coordinate. It is 16 half ulps; the
// projection of a vertex needs 5 of them and the planes of a box need 4.
const float TRACE_SLACK = 9.5367432e-7;  // 2^-20

// A ray in the space of a tree.
struct TraceSpace {
  vec3 origin;
  vec3 x, y, z;      // rows: x and y across the ray, z along it, so that dot(p - origin, z) is t
  vec3 inverse;      // 1 / direction, finite
  vec3 towards;      // the slack, with the signs of the direction
  vec3 near, far;    // origin moved back and forth by it, for near and far planes; unused on a card,
                     // which works them out for each record rather than keep them
  uint octant;       // bit i is set if component i of the direction is negative
  uint first_texel;  // of the tree
  uint presence, instance;
};

// Takes the ray into the space of the tree that a space record names.
TraceSpace trace_enter(uint record, vec3 world_origin, vec3 world_direction) {
  const int texel = int(record * 4u);
  const uvec4 head = fetch(bvh, texel);
  const vec4 row0 = uintBitsToFloat(fetch(bvh, texel + 1));
  const vec4 row1 = uintBitsToFloat(fetch(bvh, texel + 2));
  const vec4 row2 = uintBitsToFloat(fetch(bvh, texel + 3));
  TraceSpace s;
  s.first_texel = (head.x >> 8) << 5;
  s.presence = head.y >> 8;
  s.instance = head.w;
  s.origin = vec3(dot(row0.xyz, world_origin) + row0.w, dot(row1.xyz, world_origin) + row1.w,
                  dot(row2.xyz, world_origin) + row2.w);
  const vec3 d = vec3(dot(row0.xyz, world_direction), dot(row1.xyz, world_direction),
                      dot(row2.xyz, world_direction));
  // The axes across the ray are those of Woop, Benthin, Wald, "Watertight Ray/Triangle
  // Intersection" (JCGT 2013), but written as rows, so that vertices need not be permuted.
  const vec3 size = abs(d);
  const float largest = max(size.x, max(size.y, size.z));
  const bool along_z = size.z == largest;
  const bool along_y = !along_z && size.y == largest;
  const vec3 slope = d / (along_z ? d.z : along_y ? d.y : d.x);
  s.x = along_z   ? vec3(1.0, 0.0, -slope.x)
        : along_y ? vec3(1.0, -slope.x, 0.0)
                  : vec3(-slope.y, 1.0, 0.0);
  s.y = along_z   ? vec3(0.0, 1.0, -slope.y)
        : along_y ? vec3(0.0, -slope.z, 1.0)
                  : vec3(-slope.z, 0.0, 1.0);
  s.z = d / dot(d, d);
  // Components of 0 are replaced; so small a slope moves the ray by less than the slack.
  const float least = largest * 1e-12;
  const vec3 steep = mix(d, vec3(least), lessThan(size, vec3(least)));
  s.inverse = 1.0 / steep;
  const vec3 reach = abs(s.origin);
  const float slack = TRACE_SLACK * (max(reach.x, max(reach.y, reach.z)) + 8388608.0);
  s.towards = mix(vec3(slack), vec3(-slack), lessThan(steep, vec3(0.0)));
  s.near = on_card() ? vec3(0.0) : s.origin + s.towards;
  s.far = on_card() ? vec3(0.0) : s.origin - s.towards;
  s.octant = (steep.x < 0.0 ? 1u : 0u) | (steep.y < 0.0 ? 2u : 0u) | (steep.z < 0.0 ? 4u : 0u);
  return s;
}

// Returns `bit` if the ray is in the box between the two distances, else 0. Floats are compared as
// integers, which gives the right answer because t_min >= 0, and needs no case for NaN.
uint trace_box(vec3 near, vec3 far, int t_min, int t_max, uint bit) {
  const ivec3 n = floatBitsToInt(near);
  const ivec3 f = floatBitsToInt(far);
  return max(max(n.x, n.y), max(n.z, t_min)) <= min(min(f.x, f.y), min(f.z, t_max)) ? bit : 0u;
}

// These return one byte of each component. On a CPU device bytes 1 and 2 are multiplied by 2^8 and
// 2^16, which the callers' scales make up for; cards turn any byte into a float at once.
vec3 trace_byte0(uvec3 planes) { return vec3(ivec3(planes & 0xffu)); }
vec3 trace_byte1(uvec3 planes) {
  return on_card() ? vec3((planes >> 8) & 0xffu) : vec3(ivec3(planes & 0xff00u));
}
vec3 trace_byte2(uvec3 planes) {
  return on_card() ? vec3((planes >> 16) & 0xffu) : vec3(ivec3(planes & 0xff0000u));
}
vec3 trace_byte3(uvec3 planes) { return vec3(ivec3(planes >> 24)); }

// Returns the bits of slots as bits of slots ^ octant.
uint trace_from_octant(uint slots, uint octant) {
  slots = (octant & 1u) != 0u ? (slots & 0x55u) << 1 | ((slots >> 1) & 0x55u) : slots;
  slots = (octant & 2u) != 0u ? (slots & 0x33u) << 2 | ((slots >> 2) & 0x33u) : slots;
  return (octant & 4u) != 0u ? (slots & 0x0fu) << 4 | ((slots >> 4) & 0x0fu) : slots;
}

struct TraceTriangle {
  float t;
  vec3 weights;  // barycentric, of its vertices
  bool hit;
};

// Intersects a triangle whose vertices a, b, c are given across and along the ray. Both triangles
// at an edge compute the same two products for it, so no ray passes between them.
TraceTriangle trace_triangle(vec3 a, vec3 b, vec3 c, float t_min, float t_max) {
  TraceTriangle r;
  precise const float u = c.x * b.y - c.y * b.x;
  precise const float v = a.x * c.y - a.y * c.x;
  precise const float w = b.x * a.y - b.y * a.x;
  const float sum = u + v + w;
  const float inverse = 1.0 / sum;
  r.weights = vec3(u, v, w) * inverse;
  r.t = (u * a.z + v * b.z + w * c.z) * inverse;
  const bool inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
  r.hit = inside && sum != 0.0 && r.t > t_min && r.t < t_max;
  return r;
}

// Returns a vertex across (x, y) and along (z) the ray.
vec3 trace_project(vec3 vertex, const TraceSpace s) {
  precise const vec3 p = vertex - s.origin;
  precise const float x = p.x * s.x.x + p.y * s.x.y + p.z * s.x.z;
  precise const float y = p.x * s.y.x + p.y * s.y.y + p.z * s.y.z;
  return vec3(x, y, dot(p, s.z));
}

// Traverses the tree for both kinds of ray. With `shadow`, which is a constant, it returns those of
// `worlds` in which the ray is blocked. Otherwise it returns 1 and sets `hit` to the closest hit,
// or returns 0.
uint trace_rays(const bool shadow, vec3 origin, vec3 direction, float t_min, float t_max,
                uint worlds, uvec2 source, inout Hit hit) {
  uint top = 0u;
  uint bottom = 0u;  // where the stack of the tree that is being traversed begins
  uint record = 0u;
  bool fresh = true;
  uint blocked = 0u;
  uint found = 0u;
  const int t_min_bits = floatBitsToInt(t_min);
  float t_cull = t_max;
  const vec3 reach = abs(origin);
  const vec3 pace = abs(direction);
  const float tie = TRACE_TIE * max(reach.x, max(reach.y, reach.z)) /
                    max(pace.x, max(pace.y, pace.z));

  for (;;) {  // one tree per turn: the top level, an instance, the top level again
    const TraceSpace s = trace_enter(record, origin, direction);
    // On a card the children that are hit are collected by slot, which takes fewer registers.
    const uint octant = on_card() ? 0u : s.octant;
    const uint b0 = 1u << octant;
    const uint b1 = 1u << (octant ^ 1u);
    const uint b2 = 1u << (octant ^ 2u);
    const uint b3 = 1u << (octant ^ 3u);
    const uint b4 = 1u << (octant ^ 4u);
    const uint b5 = 1u << (octant ^ 5u);
    const uint b6 = 1u << (octant ^ 6u);
    const uint b7 = 1u << (octant ^ 7u);
    const bvec3 backwards = lessThan(s.inverse, vec3(0.0));
    // A pair's primitive is stored above eight other bits.
    const uint left_out = s.instance == source.x ? source.y << 8 : 0xffffffffu;
    uint group = fresh && (s.presence & worlds & ~blocked) != 0u ? 1u << s.octant : 0u;
    uint entered = 0u;

    for (;;) {  // one record per turn
      if ((group & 0xffu) == 0u) {
        if (top == bottom) break;
        top--;
        group = trace_kept(top);
      }
      // The lowest bit belongs to the nearest child; bit i stands for slot i ^ octant.
      const uint bit = group & (~group + 1u);
      group ^= bit;
      const uint slot = ((floatBitsToUint(float(int(bit))) >> 23) - 127u) ^ s.octant;
      const uint texel = s.first_texel + ((group >> 8) << 5) + (slot << 2);
      const uvec4 head = fetch(bvh, int(texel));
      const uvec4 w1 = fetch(bvh, int(texel) + 1);
      const uvec4 w2 = fetch(bvh, int(texel) + 2);
      const uvec4 w3 = fetch(bvh, int(texel) + 3);
      const uint kind = head.z & 0xffu;

      // The record is tested as a node.
      if (!on_card() || kind >= RECORD_NODE) {
        const vec3 corner = vec3(ivec3(head.xyz) >> 8);
        const vec3 scale = uintBitsToFloat((head.xyz << 23) & 0x7f800000u) * s.inverse;
        const vec3 scale1 = on_card() ? scale : scale * 0.00390625;
        const vec3 scale2 = on_card() ? scale : scale * 1.52587890625e-5;
        const vec3 before = on_card() ? s.origin + s.towards : s.near;
        const vec3 behind = on_card() ? s.origin - s.towards : s.far;
        const vec3 near = (corner - before) * s.inverse;
        const vec3 far = (corner - behind) * s.inverse;
        const uvec3 low0 = uvec3(w1.x, w2.x, w3.x);
        const uvec3 low1 = uvec3(w1.y, w2.y, w3.y);
        const uvec3 high0 = uvec3(w1.z, w2.z, w3.z);
        const uvec3 high1 = uvec3(w1.w, w2.w, w3.w);
        const uvec3 n0 = mix(low0, high0, backwards);
        const uvec3 n1 = mix(low1, high1, backwards);
        const uvec3 f0 = mix(high0, low0, backwards);
        const uvec3 f1 = mix(high1, low1, backwards);
        const int cull = floatBitsToInt(t_cull);
        uint hits = trace_box(trace_byte0(n0) * scale + near, trace_byte0(f0) * scale + far, t_min_bits, cull, b0);
        hits |= trace_box(trace_byte1(n0) * scale1 + near, trace_byte1(f0) * scale1 + far, t_min_bits, cull, b1);
        hits |= trace_box(trace_byte2(n0) * scale2 + near, trace_byte2(f0) * scale2 + far, t_min_bits, cull, b2);
        hits |= trace_box(trace_byte3(n0) * scale + near, trace_byte3(f0) * scale + far, t_min_bits, cull, b3);
        hits |= trace_box(trace_byte0(n1) * scale + near, trace_byte0(f1) * scale + far, t_min_bits, cull, b4);
        hits |= trace_box(trace_byte1(n1) * scale1 + near, trace_byte1(f1) * scale1 + far, t_min_bits, cull, b5);
        hits |= trace_box(trace_byte2(n1) * scale2 + near, trace_byte2(f1) * scale2 + far, t_min_bits, cull, b6);
        hits |= trace_box(trace_byte3(n1) * scale + near, trace_byte3(f1) * scale + far, t_min_bits, cull, b7);
        if (on_card()) hits = trace_from_octant(hits, s.octant);
        trace_keep(top, group);
        const bool descend = kind >= RECORD_NODE && hits != 0u;
        top += descend && (group & 0xffu) != 0u ? 1u : 0u;
        group = descend ? head.w << 8 | hits : group;
      }

      // The record is tested as a pair of triangles.
      if (!on_card() || kind == RECORD_PAIR) {
        const vec3 p0 = trace_project(uintBitsToFloat(w1.xyz), s);
        const vec3 p1 = trace_project(uintBitsToFloat(uvec3(w1.w, w2.xy)), s);
        const vec3 p2 = trace_project(uintBitsToFloat(uvec3(w2.zw, w3.x)), s);
        const vec3 p3 = trace_project(uintBitsToFloat(w3.yzw), s);
        TraceTriangle first = trace_triangle(p0, p1, p2, t_min, t_max);
        TraceTriangle second = trace_triangle(p0, p2, p3, t_min, t_max);
        first.hit = first.hit && (head.x ^ left_out) > 0xffu;
        second.hit = second.hit && (head.y ^ left_out) > 0xffu;
        const bool is_pair = kind == RECORD_PAIR;
        if (shadow) {
          if (is_pair && (first.hit || second.hit)) {
            blocked |= s.presence & worlds;
            group = 0u;
            top = bottom;
          }
        } else {
          const bool take_second = second.hit && (!first.hit || second.t < first.t || (second.t == first.t && head.y < head.x));
          const float t = take_second ? second.t : first.t;
          const vec3 weights = take_second ? second.weights : first.weights;
          const uint primitive = take_second ? head.y : head.x;
          const bool same = found == 0u || s.instance == hit.instance;
          const float gap = t - hit.t;
          const bool tied = abs(gap) <= (same ? 0.0 : tie + TRACE_TIE * t);
          const bool wins = found == 0u || (tied ? (same ? primitive < hit.primitive : s.instance < hit.instance) : gap < 0.0);
          if (is_pair && (first.hit || second.hit) && wins) {
            found = 1u;
            hit.t = t;
            hit.barycentrics = weights.yz;
            hit.instance = s.instance;
            hit.primitive = primitive;
            hit.presence = s.presence;
            t_cull = min(t_max, t + (tie + TRACE_TIE * t));
          }
        }
      }

      if (kind == RECORD_SPACE && ((head.y >> 8) & worlds & ~blocked) != 0u) {
        entered = texel >> 2;
        break;
      }
    }

    if (entered != 0u) {
      if ((group & 0xffu) != 0u) {
        trace_keep(top, group);
        top++;
      }
      bottom = top;
      record = entered;
      fresh = true;
    } else {
      if (record == 0u || top == 0u || blocked == worlds) break;
      bottom = 0u;
      record = 0u;
      fresh = false;
    }
  }
  return shadow ? blocked : found;
}

bool trace_closest(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds, uvec2 source,
                   out Hit hit) {
  hit = Hit(t_max, vec2(0.0), 0xffffffffu, 0xffffffffu, 0u);
  const bool found =
      trace_rays(false, origin, direction, t_min, t_max, worlds, source, hit) != 0u;
  // The stored vertices are those of the primitive, rotated left; the weights are rotated back.
  const uint rotation = hit.primitive & 3u;
  const vec3 stored = vec3(1.0 - hit.barycentrics.x - hit.barycentrics.y, hit.barycentrics);
  hit.barycentrics = rotation == 0u ? stored.yz : rotation == 1u ? stored.xy : stored.zx;
  hit.primitive >>= 8;
  return found;
}

uint trace_blocked(vec3 origin, vec3 direction, float t_min, float t_max, uint worlds,
                   uvec2 source) {
  Hit unused;
  return trace_rays(true, origin, direction, t_min, t_max, worlds, source, unused);
}

#endif
