#include "daemon/core/scene/gltf_deformation.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <limits>

#include "daemon/core/scene/gltf_accessor.hpp"
#include "daemon/core/scene/gltf_nodes.hpp"
#include "daemon/core/scene/transform.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

std::size_t index_of(int index) {
  return static_cast<std::size_t>(index);
}

int attribute_of(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto at = attributes.find(name);
  return at == attributes.end() ? -1 : at->second;
}

std::vector<Deformation::Joint> read_joints(const tinygltf::Model& model, int index,
                                            const std::string& where, FileNodes& nodes,
                                            Budget& budget) {
  if (index_of(index) >= model.skins.size())
    throw Error(where + ": no skin " + std::to_string(index));
  const tinygltf::Skin& skin = model.skins[index_of(index)];
  const std::string what = where + ": skin " + std::to_string(index);
  if (skin.joints.empty() || skin.joints.size() > std::numeric_limits<std::uint16_t>::max())
    throw Error(what + ": has " + std::to_string(skin.joints.size()) + " joints");
  budget.add_joints(skin.joints.size(), what);
  std::vector<Deformation::Joint> joints(skin.joints.size());
  if (skin.inverseBindMatrices >= 0) {
    // There may be more matrices than joints, and all of them are read.
    const std::string at = what + ", inverse bind matrices";
    const std::uint64_t count = element_count(model, skin.inverseBindMatrices, at);
    if (count > joints.size()) budget.add_joints(count - joints.size(), at);
    const std::vector<glm::dmat4> matrices =
        read_mat4s(model, skin.inverseBindMatrices, what + ", inverse bind matrices");
    if (matrices.size() < joints.size())
      throw Error(what + ": has fewer inverse bind matrices than joints");
    for (std::size_t i = 0; i < joints.size(); ++i) {
      joints[i].joint_from_mesh = matrices[i];
      if (!is_finite(matrices[i]))
        throw Error(what + ": inverse bind matrix " + std::to_string(i) + " is not finite");
    }
  }
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (skin.joints[i] < 0 || index_of(skin.joints[i]) >= model.nodes.size())
      throw Error(what + ": no node " + std::to_string(skin.joints[i]));
    joints[i].file_from_joint = nodes.file_from_node(skin.joints[i]);
  }
  return joints;
}

std::vector<double> weights_at_rest(const tinygltf::Model& model, const tinygltf::Node& node,
                                    const std::string& where) {
  const tinygltf::Mesh& mesh = model.meshes[index_of(node.mesh)];
  const std::size_t targets = mesh.primitives.empty() ? 0 : mesh.primitives.front().targets.size();
  const std::vector<double>& given = node.weights.empty() ? mesh.weights : node.weights;
  std::vector<double> weights(targets, 0);
  if (!given.empty() && given.size() != targets)
    throw Error(where + ": has " + std::to_string(given.size()) + " weights for " +
                std::to_string(targets) + " morph targets");
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (!std::isfinite(given[i])) throw Error(where + ": a morph target's weight is not finite");
    weights[i] = given[i];
  }
  return weights;
}

// Makes the weights of a vertex not negative, with a sum of 1; false where they were none.
bool normalise(std::span<Influence> influences) {
  double sum = 0;
  for (Influence& influence : influences) {
    for (int k = 0; k < 4; ++k) {
      float& weight = influence.weights[k];
      if (!(weight > 0) || !std::isfinite(weight)) weight = 0;
      sum += static_cast<double>(weight);
    }
  }
  if (!(sum > 0)) {
    influences[0] = {{}, {1, 0, 0, 0}};
    return false;
  }
  for (Influence& influence : influences)
    for (int k = 0; k < 4; ++k)
      influence.weights[k] = static_cast<float>(static_cast<double>(influence.weights[k]) / sum);
  return true;
}

void read_influences(const tinygltf::Model& model, const MeshSource& source,
                     const std::string& where, const std::string& what, Notes& notes, Mesh& mesh) {
  const std::size_t sets = source.influences.size(), vertices = mesh.positions.size();
  mesh.undeformed.influences_per_vertex = static_cast<std::uint32_t>(sets);
  std::vector<Influence>& influences = mesh.undeformed.influences;
  influences.resize(sets * vertices);
  for (std::size_t set = 0; set < sets; ++set) {
    const auto joints =
        read_vec4s(model, source.influences[set].first, where + ", joints", Components::joints);
    const auto weights =
        read_vec4s(model, source.influences[set].second, where + ", weights", Components::weights);
    if (joints.size() != vertices || weights.size() != vertices)
      throw Error(where + ": its attributes have different numbers of elements");
    for (std::size_t v = 0; v < vertices; ++v) {
      Influence& influence = influences[v * sets + set];
      influence.weights = weights[v];
      for (int k = 0; k < 4; ++k) {
        const float joint = joints[v][k];
        if (!(weights[v][k] > 0)) continue;  // its joint may be anything
        if (!(joint >= 0 && joint < static_cast<float>(source.joints)))
          throw Error(where + ": a vertex follows joint " + std::to_string(std::lround(joint)) +
                      ", but there are " + std::to_string(source.joints));
        influence.joints[static_cast<std::size_t>(k)] = static_cast<std::uint16_t>(joint);
      }
    }
  }
  std::uint64_t without = 0;
  for (std::size_t v = 0; v < vertices; ++v)
    without += normalise(std::span(influences).subspan(v * sets, sets)) ? 0 : 1;
  if (without > 0)
    notes.add(what + ": " + std::to_string(without) +
              " vertices follow no joint; the skin's first joint is used");
}

}  // namespace

NodeDeformation read_node_deformation(const tinygltf::Model& model, int index,
                                      const std::string& where, FileNodes& file_nodes,
                                      Budget& budget, GltfAnimation* played,
                                      std::vector<AnimatedNode>& nodes) {
  const tinygltf::Node& node = model.nodes[index_of(index)];
  NodeDeformation result;
  Deformation& deformation = result.deformation;
  if (node.skin >= 0) {
    result.is_skinned = true;
    deformation.joints = read_joints(model, node.skin, where, file_nodes, budget);
    for (std::size_t i = 0; played && i < deformation.joints.size(); ++i) {
      deformation.joints[i].node = played->use(model.skins[index_of(node.skin)].joints[i], nodes);
      result.is_skin_moved |= deformation.joints[i].node != no_node;
    }
  }
  deformation.weights = weights_at_rest(model, node, where);
  if (played && !deformation.weights.empty())
    deformation.weight_channel = played->weights_of(index, deformation.weights.size());
  result.are_weights_moved = !deformation.weight_channel.times_s.empty();
  result.is_morphed = result.are_weights_moved ||
                      std::ranges::any_of(deformation.weights, [](double w) { return w != 0; });
  return result;
}

bool follows_joints(const tinygltf::Primitive& primitive, const NodeDeformation& node) {
  return node.is_skinned && attribute_of(primitive.attributes, "JOINTS_0") >= 0 &&
         attribute_of(primitive.attributes, "WEIGHTS_0") >= 0;
}

void add_deformation(const tinygltf::Primitive& primitive, const NodeDeformation& node,
                     const std::string& where, MeshSource& source) {
  for (int set = 0; node.is_skinned; ++set) {
    const int joints = attribute_of(primitive.attributes, "JOINTS_" + std::to_string(set));
    const int weights = attribute_of(primitive.attributes, "WEIGHTS_" + std::to_string(set));
    if (joints < 0 || weights < 0) break;
    source.influences.emplace_back(joints, weights);
  }
  if (!source.influences.empty()) source.joints = node.deformation.joints.size();
  if (!node.is_morphed) return;
  if (primitive.targets.size() != node.deformation.weights.size())
    throw Error(where + ": has " + std::to_string(primitive.targets.size()) +
                " morph targets for " + std::to_string(node.deformation.weights.size()) +
                " weights");
  for (const std::map<std::string, int>& target : primitive.targets)
    source.targets.emplace_back(attribute_of(target, "POSITION"), attribute_of(target, "NORMAL"));
}

void read_undeformed(const tinygltf::Model& model, const MeshSource& source,
                     const std::string& where, const std::string& what, Notes& notes, Mesh& mesh) {
  const auto offsets = [&](int accessor, Components use) {
    std::vector<glm::vec3> values = read_vec3s(model, accessor, where + ", morph target", use);
    if (values.size() != mesh.positions.size())
      throw Error(where + ": its morph targets have different numbers of elements");
    for (glm::vec3& value : values)
      if (!(glm::abs(value.x) + glm::abs(value.y) + glm::abs(value.z) < 1e15f))
        value = glm::vec3(0);
    return values;
  };
  for (const auto& [positions, normals] : source.targets) {
    MorphTarget target;
    if (positions >= 0)
      target.positions = offsets(positions, Components::positions);
    else
      target.positions.resize(mesh.positions.size(), glm::vec3(0));
    if (normals >= 0) target.normals = offsets(normals, Components::normals);
    mesh.undeformed.targets.push_back(std::move(target));
  }
  if (!source.influences.empty()) read_influences(model, source, where, what, notes, mesh);
}

}  // namespace previz::scene
