// Reads an animation of a glTF file, or all of them at once (glTF 2.0, 3.11).
#pragma once

#include <tiny_gltf.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/scene/animation.hpp"
#include "daemon/core/scene/deformation.hpp"
#include "daemon/core/scene/load_log.hpp"

namespace previz::scene {

// Returns "it has 0 "sway" (2 s); give the name, the index or "*" for all".
std::string list_of_animations(const tinygltf::Model& model);

// Reads what is played and adds the nodes that it moves to an object's list as they are used.
class GltfAnimation {
 public:
  // `which` is the name of an animation (the first of equal names), its index in decimal digits
  // where no animation has that name, or "*" for all of them. Where two of all animate the same
  // property of a node, the later one plays and a note says so. Throws previz::Error naming `file`
  // and listing its animations if `which` is none of them, or if keys cannot be understood.
  // Channels of what glTF 2.0 itself does not name are noted and left out.
  GltfAnimation(const tinygltf::Model& model, const std::string& which, const std::string& file,
                Notes& notes);

  // The duration of the longest animation that is played.
  double duration_s() const { return duration_s_; }
  // Returns the index in `nodes` of a node that moves, by itself or with an ancestor; the node and
  // its ancestors are added if they are not there yet. Returns no_node if the node stands still.
  std::uint32_t use(int node, std::vector<AnimatedNode>& nodes);
  // Returns how the weights of the node's morph targets change; the channel is empty where they do
  // not. Throws previz::Error if it does not have `targets` weights a key.
  WeightChannel weights_of(int node, std::size_t targets) const;

 private:
  void read_channel(std::size_t index, const tinygltf::AnimationChannel& given,
                    const std::string& where);
  void note_replaced(std::size_t index, const tinygltf::AnimationChannel& given);
  void find_moved();
  std::uint32_t take_up(int node, std::vector<AnimatedNode>& nodes);

  const tinygltf::Model& model_;
  std::string file_;
  Notes& notes_;
  double duration_s_ = 0;
  // The animation that was read last for a node and a property of it.
  std::map<std::pair<int, std::string>, std::size_t> player_;
  // These arrays have one entry per node of the file.
  std::vector<int> parents_;  // -1: a root
  std::vector<AnimatedNode> moved_;
  std::vector<WeightChannel> weights_;
  std::vector<bool> is_moved_;  // the node or an ancestor
  std::vector<std::uint32_t> taken_up_;
};

}  // namespace previz::scene
