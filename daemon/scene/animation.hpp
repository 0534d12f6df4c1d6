// Node transforms that change with time (glTF 2.0, 3.11): what is played, and where it puts things.
#pragma once

#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

namespace previz::scene {

enum class Interpolation { step, linear, cubic_spline };

// One component of one node over time.
struct AnimationChannel {
  Interpolation interpolation = Interpolation::linear;
  std::vector<double> times_s;  // increasing; empty: nothing moves
  // One a time, of a cubic spline three: in-tangent, value, out-tangent. Three numbers, or four of
  // a quaternion (x, y, z, w).
  std::vector<glm::dvec4> values;
};

// The value at a time, before the first as at the first, after the last as at the last. The channel
// must not be empty. Rotations: the shorter way around, of length 1 (glTF 2.0, C.4 and C.5).
glm::dvec3 vector_at(const AnimationChannel& channel, double time_s);
glm::dquat rotation_at(const AnimationChannel& channel, double time_s);

inline constexpr std::uint32_t no_node = 0xffffffffu;

struct AnimatedNode {
  std::uint32_t parent = no_node;  // comes before it
  bool moves = false;              // false: it stays at parent_from_node under its parent
  glm::dmat4 parent_from_node{1.0};
  glm::dvec3 translation{0}, scale{1};  // where no channel says otherwise
  glm::dquat rotation{1, 0, 0, 0};
  AnimationChannel translations, rotations, scales;
};

// What moves by itself of one object of the set, in its file's own space.
struct Animation {
  struct Use {
    std::uint32_t what = 0;  // index of an instance or a light of the scene
    std::uint32_t node = 0;
  };
  std::uint32_t object = 0;  // of the set
  double duration_s = 0;     // > 0
  bool loops = true;         // false: it stays at its end
  glm::dmat4 world_from_file{1.0};
  std::vector<AnimatedNode> nodes;
  std::vector<Use> instances, lights;
};

// Where each node is at a time from the start; world space, as the set has the object.
std::vector<glm::dmat4> world_from_nodes(const Animation& animation, double time_s);
// The same of the file as it is: with nothing played.
std::vector<glm::dmat4> world_from_nodes_at_rest(const Animation& animation);

}  // namespace previz::scene
