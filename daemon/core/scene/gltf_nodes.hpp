// Flattens the node hierarchy of a glTF file to a list with world matrices (glTF 2.0, 3.5.3).
#pragma once

#include <tiny_gltf.h>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

struct PlacedNode {
  int node = 0;
  glm::dmat4 file_from_node{1.0};
  NamedTag tag = {};  // by its own name, or that of the nearest ancestor that names one
};

// Returns nodes of the default scene (or the first, or all roots), parents before children: the
// nodes called `names` with their descendants, or all nodes where `names` is empty. A node that the
// file hides (KHR_node_visibility) is left out with its descendants, unless `names` has it: who
// names a node wants to see it, which is noted. Throws previz::Error naming `file` if the nodes are
// no tree or a name does not exist.
std::vector<PlacedNode> place_nodes(const tinygltf::Model& model,
                                    const std::vector<std::string>& names, const std::string& file,
                                    Notes& notes);

// A node's own transform; one given as a matrix is not split into parts.
struct NodeTransform {
  glm::dmat4 parent_from_node{1.0};
  glm::dvec3 translation{0}, scale{1};
  glm::dquat rotation{1, 0, 0, 0};
};
// Throws previz::Error beginning with `where` if the numbers are no valid transform.
NodeTransform transform_of(const tinygltf::Node& node, const std::string& where);

// Returns the places of a node's copies (EXT_mesh_gpu_instancing), or the node's own. Throws
// previz::Error beginning with `where` if the copies' accessors make no sense.
std::vector<glm::dmat4> node_from_copies(const tinygltf::Model& model, const tinygltf::Node& node,
                                         const std::string& where);

// Returns the parent of each node of the file, -1 for a root. Throws previz::Error naming `file` if
// a child does not exist or has two parents.
std::vector<int> parents_of(const tinygltf::Model& model, const std::string& file);

// The places of a file's nodes at rest, also of those that no scene has. Each is found once.
class FileNodes {
 public:
  FileNodes(const tinygltf::Model& model, std::string file)
      : model_(model), file_(std::move(file)) {}
  // Throws previz::Error naming the file if the nodes are no tree. The node must exist.
  glm::dmat4 file_from_node(int node);

 private:
  const tinygltf::Model& model_;
  std::string file_;
  std::vector<int> parents_;  // empty before the first use
  std::vector<std::optional<glm::dmat4>> places_;
};

// Returns a name for messages: "node 3 "cow"".
std::string node_name(const tinygltf::Model& model, int node);

}  // namespace previz::scene
