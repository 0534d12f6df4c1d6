// An animation of a glTF file by its name (glTF 2.0, 3.11).
#pragma once

#include <tiny_gltf.h>

#include <string>
#include <vector>

#include "daemon/scene/animation.hpp"
#include "daemon/scene/load_log.hpp"

namespace previz::scene {

// The animated nodes of one object, taken up as they are used.
class GltfAnimation {
 public:
  // Throws previz::Error naming `file` where there is no animation of this name (and the nearest
  // that is there), or its keys cannot be understood. Channels that move no node's place (morph
  // weights) are noted and left out.
  GltfAnimation(const tinygltf::Model& model, const std::string& name, const std::string& file,
                Notes& notes);

  double duration_s() const { return duration_s_; }
  // Index in `nodes` of a node that the animation moves, itself or with one above it: taken up with
  // all above it where it is not there yet. no_node: it stands still.
  std::uint32_t use(int node, std::vector<AnimatedNode>& nodes);

 private:
  void read_channel(const tinygltf::Animation& animation, const tinygltf::AnimationChannel& given,
                    const std::string& where);
  void find_parents();
  void find_moved();
  std::uint32_t take_up(int node, std::vector<AnimatedNode>& nodes);

  const tinygltf::Model& model_;
  std::string file_;
  Notes& notes_;
  double duration_s_ = 0;
  // Of every node of the file.
  std::vector<int> parents_;  // -1: a root
  std::vector<AnimatedNode> moved_;
  std::vector<bool> is_moved_;  // itself, or one above it
  std::vector<std::uint32_t> taken_up_;
};

}  // namespace previz::scene
