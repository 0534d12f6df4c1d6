// Reads an animation of a glTF file by its name (glTF 2.0, 3.11).
#pragma once

#include <tiny_gltf.h>

#include <string>
#include <vector>

#include "daemon/scene/animation.hpp"
#include "daemon/scene/deformation.hpp"
#include "daemon/scene/load_log.hpp"

namespace previz::scene {

// Reads one animation and adds the nodes that it moves to an object's list as they are used.
class GltfAnimation {
 public:
  // Throws previz::Error naming `file` and the most similar name if there is no animation of this
  // name, or if its keys cannot be understood. Channels of what glTF 2.0 itself does not name are
  // noted and left out.
  GltfAnimation(const tinygltf::Model& model, const std::string& name, const std::string& file,
                Notes& notes);

  double duration_s() const { return duration_s_; }
  // Returns the index in `nodes` of a node that moves, by itself or with an ancestor; the node and
  // its ancestors are added if they are not there yet. Returns no_node if the node stands still.
  std::uint32_t use(int node, std::vector<AnimatedNode>& nodes);
  // Returns how the weights of the node's morph targets change; the channel is empty where they do
  // not. Throws previz::Error if it does not have `targets` weights a key.
  WeightChannel weights_of(int node, std::size_t targets) const;

 private:
  void read_channel(const tinygltf::Animation& animation, const tinygltf::AnimationChannel& given,
                    const std::string& where);
  void find_moved();
  std::uint32_t take_up(int node, std::vector<AnimatedNode>& nodes);

  const tinygltf::Model& model_;
  std::string file_;
  Notes& notes_;
  double duration_s_ = 0;
  // These arrays have one entry per node of the file.
  std::vector<int> parents_;  // -1: a root
  std::vector<AnimatedNode> moved_;
  std::vector<WeightChannel> weights_;
  std::vector<bool> is_moved_;  // the node or an ancestor
  std::vector<std::uint32_t> taken_up_;
};

}  // namespace previz::scene
