#include "daemon/core/scene/animation.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>

namespace previz::scene {
namespace {

// Interpolates by a Hermite spline with tangents per second (glTF 2.0, C.5).
glm::dvec4 cubic(const AnimationChannel& channel, const KeySegment& s) {
  const auto at = [&](std::size_t key, std::size_t part) { return channel.values[3 * key + part]; };
  if (s.before == s.after) return at(s.before, 1);
  const double t = s.part, t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * at(s.before, 1) +
         s.duration_s * (t3 - 2 * t2 + t) * at(s.before, 2) + (3 * t2 - 2 * t3) * at(s.after, 1) +
         s.duration_s * (t3 - t2) * at(s.after, 0);
}

glm::dquat quaternion(const glm::dvec4& xyzw) {
  return glm::normalize(glm::dquat(xyzw.w, xyzw.x, xyzw.y, xyzw.z));
}

glm::dmat4 parent_from_node(const AnimatedNode& node, double time_s) {
  if (!node.moves) return node.parent_from_node;
  const auto moved = [&](const AnimationChannel& channel, const glm::dvec3& otherwise) {
    return channel.times_s.empty() ? otherwise : vector_at(channel, time_s);
  };
  const glm::dquat rotation =
      node.rotations.times_s.empty() ? node.rotation : rotation_at(node.rotations, time_s);
  return glm::scale(glm::translate(glm::dmat4(1), moved(node.translations, node.translation)) *
                        glm::mat4_cast(rotation),
                    moved(node.scales, node.scale));
}

template <class Local>
std::vector<glm::dmat4> down_the_tree(const Animation& animation, const Local& local) {
  std::vector<glm::dmat4> world;
  for (const AnimatedNode& node : animation.nodes)
    world.push_back((node.parent == no_node ? animation.world_from_file : world[node.parent]) *
                    local(node));
  return world;
}

}  // namespace

KeySegment segment_at(std::span<const double> times, double time_s) {
  const auto next = std::ranges::upper_bound(times, time_s);
  if (next == times.begin()) return {};
  const auto after = static_cast<std::size_t>(next - times.begin());
  if (next == times.end()) return {after - 1, after - 1, 0, 0};
  const double duration = *next - times[after - 1];
  return {after - 1, after, (time_s - times[after - 1]) / duration, duration};
}

glm::dvec3 vector_at(const AnimationChannel& channel, double time_s) {
  const KeySegment s = segment_at(channel.times_s, time_s);
  switch (channel.interpolation) {
    case Interpolation::step:
      return glm::dvec3(channel.values[s.before]);
    case Interpolation::linear:
      return glm::mix(glm::dvec3(channel.values[s.before]), glm::dvec3(channel.values[s.after]),
                      s.part);
    case Interpolation::cubic_spline:
      break;
  }
  return glm::dvec3(cubic(channel, s));
}

glm::dquat rotation_at(const AnimationChannel& channel, double time_s) {
  const KeySegment s = segment_at(channel.times_s, time_s);
  switch (channel.interpolation) {
    case Interpolation::step:
      return quaternion(channel.values[s.before]);
    case Interpolation::linear:
      return glm::normalize(glm::slerp(quaternion(channel.values[s.before]),
                                       quaternion(channel.values[s.after]), s.part));
    case Interpolation::cubic_spline:
      break;
  }
  return quaternion(cubic(channel, s));
}

double played_time(const Animation& animation, double time_s) {
  return animation.loops ? std::fmod(time_s, animation.duration_s)
                         : std::min(time_s, animation.duration_s);
}

std::vector<glm::dmat4> world_from_nodes(const Animation& animation, double time_s) {
  const double time = played_time(animation, time_s);
  return down_the_tree(animation,
                       [time](const AnimatedNode& node) { return parent_from_node(node, time); });
}

std::vector<glm::dmat4> world_from_nodes_at_rest(const Animation& animation) {
  return down_the_tree(animation, [](const AnimatedNode& node) { return node.parent_from_node; });
}

}  // namespace previz::scene
