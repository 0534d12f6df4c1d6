// The node hierarchy of a glTF file as a flat list with world matrices (glTF 2.0, 3.5.3).
#pragma once

#include <tiny_gltf.h>

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/scene/load_log.hpp"

namespace previz::scene {

struct PlacedNode {
  int node = 0;
  glm::dmat4 file_from_node{1.0};
};

// Nodes of the default scene (else the first, else all roots), parents before children, those of
// `names` with what hangs below them, or all where `names` is empty. Throws previz::Error naming
// `file` where the nodes are no tree or a name is not there.
std::vector<PlacedNode> place_nodes(const tinygltf::Model& model,
                                    const std::vector<std::string>& names, const std::string& file,
                                    Notes& notes);

// What a node says of its own place; a matrix has no parts.
struct NodeTransform {
  glm::dmat4 parent_from_node{1.0};
  glm::dvec3 translation{0}, scale{1};
  glm::dquat rotation{1, 0, 0, 0};
};
// Throws previz::Error beginning with `where` where the numbers are none of it.
NodeTransform transform_of(const tinygltf::Node& node, const std::string& where);

// "node 3 "cow"", for messages.
std::string node_name(const tinygltf::Model& model, int node);

}  // namespace previz::scene
