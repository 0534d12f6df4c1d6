// Reads what changes the shape of meshes: skins, morph targets and their weights (glTF 2.0, 3.7.2
// and 3.7.3).
#pragma once

#include <tiny_gltf.h>

#include <string>

#include "daemon/core/scene/gltf_animation.hpp"
#include "daemon/core/scene/gltf_mesh_source.hpp"
#include "daemon/core/scene/gltf_nodes.hpp"
#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// The influences that change the shape of a node's mesh. Only the weights, their channel and the
// joints of `deformation` are set.
struct NodeDeformation {
  Deformation deformation;
  bool is_skinned = false, is_skin_moved = false;
  bool is_morphed = false, are_weights_moved = false;  // some weight is not 0, or changes
};

// Reads the skin and the weights of a node that has a mesh. `played` may be null; the joints that
// it moves are added to `nodes`. Throws previz::Error beginning with `where` for a skin, a joint or
// a matrix that is not there or makes no sense.
NodeDeformation read_node_deformation(const tinygltf::Model& model, int node,
                                      const std::string& where, FileNodes& file_nodes,
                                      Budget& budget, GltfAnimation* played,
                                      std::vector<AnimatedNode>& nodes);

// Returns whether the node's skin moves the primitive. If not, the node itself places it.
bool follows_joints(const tinygltf::Primitive& primitive, const NodeDeformation& node);

// Adds the primitive's joints and targets to the source of its mesh, as far as the node uses them.
// Throws previz::Error beginning with `where` if their number does not fit the weights'.
void add_deformation(const tinygltf::Primitive& primitive, const NodeDeformation& node,
                     const std::string& where, MeshSource& source);

// Reads influences and targets into `mesh.undeformed`; the mesh has its positions, as many as the
// file. Throws previz::Error beginning with `where`.
void read_undeformed(const tinygltf::Model& model, const MeshSource& source,
                     const std::string& where, const std::string& what, Notes& notes, Mesh& mesh);

}  // namespace previz::scene
