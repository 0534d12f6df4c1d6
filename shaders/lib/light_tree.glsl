// The tree of lamps: the lamp of a light sample is found by descending from the root, each time into
// a child by its importance, a bound on what its lamps bring to the receiver (shaders/README.md, "The
// tree of lamps"; daemon/core/render/world/light_tree.cpp builds it).
#ifndef PREVIZ_LIGHT_TREE_GLSL
#define PREVIZ_LIGHT_TREE_GLSL

#include "shaders/lib/sampler.glsl"
#include "shaders/lib/scene.glsl"

// The tree's nodes, three to a GpuLightNode.
PREVIZ_FETCHED(uvec4, light_tree)

GpuLightNode light_node(uint index) {
  const int first = 3 * int(index);
  const uvec4 a = fetch(light_tree, first);
  const uvec4 b = fetch(light_tree, first + 1);
  const uvec4 c = fetch(light_tree, first + 2);
  return GpuLightNode(uintBitsToFloat(a.xyz), uintBitsToFloat(a.w), uintBitsToFloat(b.xyz),
                      uintBitsToFloat(b.w), uintBitsToFloat(c.x), uintBitsToFloat(c.y), c.z, c.w);
}

// A point of a surface on which lamps shine. A receiver that takes light from behind, too, has no
// normal, (0, 0, 0).
struct Receiver {
  vec3 position;  // from the tree's origin
  vec3 normal;
};

// A path keeps the normal of its last vertex in 32 bits, for the weight of a lamp that it meets. This
// is the code of no normal, which no normal has.
const uint NO_NORMAL = 0x80008000u;

// Maps a direction to the octahedron, of which the lower half is folded over the upper one, and its
// square to two numbers of 16 bits.
uint pack_normal(vec3 n) {
  vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
  if (n.z < 0.0) p = (1.0 - abs(p.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(p, vec2(0.0)));
  return packSnorm2x16(p);
}

Receiver make_receiver(vec3 position, uint packed) {
  Receiver r = Receiver(position + frame.tree_offset, vec3(0.0));
  if (packed == NO_NORMAL) return r;
  const vec2 p = unpackSnorm2x16(packed);
  r.normal = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  if (r.normal.z < 0.0)
    r.normal.xy = (1.0 - abs(p.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(p, vec2(0.0)));
  r.normal = normalize(r.normal);
  return r;
}

// The packed normal may be turned by 2^-15 or so, and what lies in the plane of a receiver by its
// rounding. Cosines down to this count as if light could arrive.
const float LEAST_RECEIVED = -1e-3;
// A bound is not smaller than this part of its largest value, as long as it is not 0.
const float LEAST_BOUND = 0.01;
const float MOST_IMPORTANCE = 1e37;

// Returns cos(max(0, a - b)) of two angles between 0 and pi, given their cosines.
float cosine_of_rest(float cos_a, float cos_b) {
  if (cos_a >= cos_b) return 1.0;
  return cos_a * cos_b + sqrt(max(0.0, (1.0 - cos_a * cos_a) * (1.0 - cos_b * cos_b)));
}

// Returns the intensity of a node's lamps times bounds on the cosines at lamp and receiver over the
// squared distance, which counts as at least the radius of their sphere. 0 only if none can shine on
// the receiver.
float node_importance(GpuLightNode node, Receiver r) {
  const vec3 to_node = node.center - r.position;
  const float distance_squared = dot(to_node, to_node);
  if (distance_squared <= node.radius_squared)
    return min(node.intensity / max(node.radius_squared, 1e-30), MOST_IMPORTANCE);
  const vec3 direction = to_node * inversesqrt(distance_squared);
  const float cos_seen = sqrt(max(0.0, 1.0 - node.radius_squared / distance_squared));
  float cos_lamp = clamp(-dot(node.axis, direction), -1.0, 1.0);
  if ((node.links & LIGHT_NODE_TWO_SIDED) != 0u) cos_lamp = abs(cos_lamp);
  const float sent = cosine_of_rest(cosine_of_rest(cos_lamp, node.cos_spread), cos_seen);
  if (sent < node.least_cosine) return 0.0;
  float result = node.intensity * max(sent, LEAST_BOUND);
  if (r.normal != vec3(0.0)) {
    const float received = cosine_of_rest(clamp(dot(direction, r.normal), -1.0, 1.0), cos_seen);
    if (received < LEAST_RECEIVED) return 0.0;
    result *= max(received, LEAST_BOUND);
  }
  return min(result / max(distance_squared, 1e-30), MOST_IMPORTANCE);
}

// A node as a descent sees it. Its importance is the sum of its children's, which a receiver among the
// lamps needs: it tells lamps nearby from a great many on the other side of the same sphere.
struct LightBranch {
  uint first, links;  // of the GpuLightNode
  float importance;
};

// A leaf stands in the place of its first child, so that a leaf and a branch take the same steps.
LightBranch light_branch(uint index, Receiver r) {
  const uvec2 words = fetch(light_tree, 3 * int(index) + 2).zw;
  const bool is_leaf = (words.y & LIGHT_NODE_LEAF) != 0u;
  const float first = node_importance(light_node(is_leaf ? index : words.x), r);
  const float second = node_importance(light_node(is_leaf ? index : words.x + 1u), r);
  return LightBranch(words.x, words.y, first + (is_leaf ? 0.0 : second));
}

// Returns whether a leaf is the second of two children, or below it. The nodes below the first child
// lie before those below the second one.
bool is_below_second(uint leaf, uint first) {
  if (leaf <= first + 1u) return leaf == first + 1u;
  const GpuLightNode second = light_node(first + 1u);
  return (second.links & LIGHT_NODE_LEAF) == 0u && leaf >= second.first;
}

// Descends to a lamp by a random number, which is stretched for each decision; `finer` continues it
// below its last bit. If a leaf is `wanted`, which NO_INDEX is not, it descends to that one. In
// `probability` is that of finding this lamp by chance; 0 where all lamps are turned away, for which
// the result is NO_INDEX.
uint descend_tree(Receiver r, uint wanted, float u, float finer, out float probability) {
  probability = 1.0;
  uvec2 at = fetch(light_tree, 2).zw;  // the root's `first` and `links`
  while ((at.y & LIGHT_NODE_LEAF) == 0u) {
    const LightBranch a = light_branch(at.x, r), b = light_branch(at.x + 1u, r);
    const float both = a.importance + b.importance;
    const float share_of_first = both > 0.0 ? a.importance / both : 0.0;
    const bool is_first = wanted == NO_INDEX ? share_of_first >= 1.0 || u + finer < share_of_first
                                             : !is_below_second(wanted, at.x);
    const float share = !(both > 0.0) ? 0.0 : is_first ? share_of_first : 1.0 - share_of_first;
    probability *= share;
    if (share <= 0.0) return NO_INDEX;
    u = clamp((is_first ? u : u - share_of_first) / share, 0.0, 0.99999994);
    finer /= share;
    at = is_first ? uvec2(a.first, a.links) : uvec2(b.first, b.links);
  }
  return at.x;
}

// Returns whether a ray may meet a lamp of a node before t_hit. The sphere is a little wider for the
// rounding of the ray.
bool crosses(GpuLightNode node, vec3 origin, vec3 direction, float t_hit) {
  const vec3 to_node = node.center - origin;
  const float along = dot(to_node, direction);
  const vec3 off = to_node - along * direction;
  const float squared = 1.001 * node.radius_squared + 1e-12 * dot(to_node, to_node);
  const float radius = sqrt(squared);
  return dot(off, off) <= squared && along >= -radius && along - radius <= t_hit;
}

// Returns the next light with an extent, and no mesh, that a ray may meet, of those below nodes with this
// bit: LIGHT_NODE_VISIBLE or LIGHT_NODE_DIFFERS; NO_INDEX at the end. `node` is where the walk stands, at
// first 0.
uint next_crossed(uint bit, inout uint node, vec3 origin, vec3 direction, float t_hit) {
  while (node != NO_INDEX) {
    const GpuLightNode n = light_node(node);
    const bool crossed = (n.links & bit) != 0u && crosses(n, origin, direction, t_hit);
    const bool is_leaf = (n.links & LIGHT_NODE_LEAF) != 0u;
    node = crossed && !is_leaf ? n.first : n.links >> LIGHT_NODE_NEXT_SHIFT;
    if (node == 0u) node = NO_INDEX;
    if (crossed && is_leaf) return n.first;
  }
  return NO_INDEX;
}

#endif
