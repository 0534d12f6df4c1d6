// Plays node transforms that change over time (glTF 2.0, 3.11): an animation as data, and the
// places it gives to nodes at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

namespace previz::scene {

enum class Interpolation { step, linear, cubic_spline };

// The keys on either side of a time, and how far the time has moved from one to the next.
struct KeySegment {
  std::size_t before = 0, after = 0;
  double part = 0;        // 0..1
  double duration_s = 0;  // of the segment
};

// `times_s` is increasing and not empty. Before the first key and after the last, both are that
// key.
KeySegment segment_at(std::span<const double> times_s, double time_s);

// One animated component of one node.
struct AnimationChannel {
  Interpolation interpolation = Interpolation::linear;
  std::vector<double> times_s;  // increasing; empty: nothing moves
  // There is one value per time, or three for a cubic spline: in-tangent, value, out-tangent. A
  // value has three numbers, or four for a quaternion (x, y, z, w).
  std::vector<glm::dvec4> values;
};

// Return the channel's value at a time: before the first key that of the first, after the last key
// that of the last. The channel must not be empty. Rotations take the shorter way around and have
// length 1 (glTF 2.0, C.4 and C.5).
glm::dvec3 vector_at(const AnimationChannel& channel, double time_s);
glm::dquat rotation_at(const AnimationChannel& channel, double time_s);

inline constexpr std::uint32_t no_node = 0xffffffffu;

struct AnimatedNode {
  std::uint32_t parent = no_node;  // the parent comes first in the list
  bool moves = false;              // false: it stays at parent_from_node under its parent
  glm::dmat4 parent_from_node{1.0};
  glm::dvec3 translation{0}, scale{1};  // where no channel says otherwise
  glm::dquat rotation{1, 0, 0, 0};
  AnimationChannel translations, rotations, scales;
};

// The animation of one object of the set, in the space of the object's file.
struct Animation {
  struct Use {
    std::uint32_t what = 0;  // index of an instance or a light of the scene
    std::uint32_t node = 0;
    glm::dmat4 node_from_object{1.0};  // of an instance that is one of the node's copies
  };
  std::uint32_t object = 0;  // index in the set
  double duration_s = 0;     // > 0
  bool loops = true;         // false: it stays at its end
  glm::dmat4 world_from_file{1.0};
  std::vector<AnimatedNode> nodes;
  std::vector<Use> instances, lights;
};

// Returns the time in the animation after so many seconds: it begins anew, or stays at its end.
double played_time(const Animation& animation, double time_s);

// Returns world_from_node of each node at a time after the start, with the object where the set has
// it.
std::vector<glm::dmat4> world_from_nodes(const Animation& animation, double time_s);
// Returns world_from_node of each node of the file as it is, with nothing played.
std::vector<glm::dmat4> world_from_nodes_at_rest(const Animation& animation);

}  // namespace previz::scene
