#include "daemon/core/scene/gltf_nodes.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <numeric>
#include <set>

#include "daemon/core/scene/gltf_accessor.hpp"
#include "daemon/core/scene/gltf_value.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

std::vector<int> root_nodes(const tinygltf::Model& model, const std::string& file, Notes& notes) {
  if (!model.scenes.empty()) {
    const int scene = model.defaultScene < 0 ? 0 : model.defaultScene;
    if (static_cast<std::size_t>(scene) >= model.scenes.size())
      throw Error(file + ": its default scene " + std::to_string(scene) + " does not exist");
    if (model.scenes.size() > 1)
      notes.add("has " + std::to_string(model.scenes.size()) + " scenes; only scene " +
                std::to_string(scene) + " is used");
    return model.scenes[static_cast<std::size_t>(scene)].nodes;
  }
  std::vector<bool> is_child(model.nodes.size());
  for (const tinygltf::Node& node : model.nodes)
    for (const int child : node.children)
      if (child >= 0 && static_cast<std::size_t>(child) < is_child.size())
        is_child[static_cast<std::size_t>(child)] = true;
  std::vector<int> roots;
  for (std::size_t i = 0; i < is_child.size(); ++i)
    if (!is_child[i]) roots.push_back(static_cast<int>(i));
  return roots;
}

// KHR_node_visibility: a node that is not visible hides its children, too.
bool is_hidden_by_itself(const tinygltf::Model& model, int node, Notes& notes) {
  const tinygltf::Value given =
      extension(model.nodes[static_cast<std::size_t>(node)].extensions, "KHR_node_visibility");
  if (!given.Has("visible")) return false;
  if (given.Get("visible").IsBool()) return !given.Get("visible").Get<bool>();
  notes.add(node_name(model, node) + ": its \"visible\" is neither true nor false; shown");
  return false;
}

}  // namespace

// A node has a matrix, or translation * rotation * scale.
NodeTransform transform_of(const tinygltf::Node& node, const std::string& where) {
  const auto has = [&](const std::vector<double>& values, std::size_t count) {
    if (values.empty()) return false;
    if (values.size() != count)
      throw Error(where + ": its transform has " + std::to_string(values.size()) +
                  " numbers where it must have " + std::to_string(count));
    return true;
  };
  NodeTransform transform;
  if (has(node.matrix, 16)) {
    transform.parent_from_node = glm::make_mat4(node.matrix.data());
    return transform;
  }
  if (has(node.translation, 3)) transform.translation = glm::make_vec3(node.translation.data());
  if (has(node.rotation, 4)) {
    const std::vector<double>& q = node.rotation;  // x, y, z, w
    const glm::dquat rotation(q[3], q[0], q[1], q[2]);
    if (!(glm::length(rotation) > 1e-12))
      throw Error(where + ": its rotation is not a quaternion of length 1");
    transform.rotation = glm::normalize(rotation);
  }
  if (has(node.scale, 3)) transform.scale = glm::make_vec3(node.scale.data());
  transform.parent_from_node = glm::scale(
      glm::translate(glm::dmat4(1.0), transform.translation) * glm::mat4_cast(transform.rotation),
      transform.scale);
  return transform;
}

std::vector<glm::dmat4> node_from_copies(const tinygltf::Model& model, const tinygltf::Node& node,
                                         const std::string& where) {
  const tinygltf::Value copies = extension(node.extensions, "EXT_mesh_gpu_instancing");
  if (!copies.Has("attributes") || !copies.Get("attributes").IsObject()) return {glm::dmat4(1)};
  const tinygltf::Value& attributes = copies.Get("attributes");
  const auto accessor = [&](const char* name) {
    return static_cast<int>(std::clamp(number(attributes, name, -1), -1.0, 2e9));
  };
  const std::string what = where + ", its copies";
  std::vector<glm::vec3> translations, scales;
  std::vector<glm::vec4> rotations;
  if (accessor("TRANSLATION") >= 0) translations = read_vec3s(model, accessor("TRANSLATION"), what);
  if (accessor("ROTATION") >= 0)
    rotations = read_vec4s(model, accessor("ROTATION"), what, Components::copies_rotated);
  if (accessor("SCALE") >= 0) scales = read_vec3s(model, accessor("SCALE"), what);
  const std::size_t count = std::max({translations.size(), rotations.size(), scales.size()});
  const auto fits = [&](std::size_t size) { return size == 0 || size == count; };
  if (!fits(translations.size()) || !fits(rotations.size()) || !fits(scales.size()))
    throw Error(what + ": their attributes have different numbers of elements");
  std::vector<glm::dmat4> places(count, glm::dmat4(1));
  for (std::size_t i = 0; i < count; ++i) {
    if (!translations.empty()) places[i] = glm::translate(places[i], glm::dvec3(translations[i]));
    if (!rotations.empty()) {
      const glm::dvec4 q = rotations[i];  // x, y, z, w
      if (!(glm::dot(q, q) > 1e-12)) throw Error(what + ": a rotation has no length");
      places[i] *= glm::mat4_cast(glm::normalize(glm::dquat(q.w, q.x, q.y, q.z)));
    }
    if (!scales.empty()) places[i] = glm::scale(places[i], glm::dvec3(scales[i]));
  }
  return places.empty() ? std::vector{glm::dmat4(1)} : places;
}

std::vector<int> parents_of(const tinygltf::Model& model, const std::string& file) {
  std::vector<int> parents(model.nodes.size(), -1);
  for (std::size_t i = 0; i < parents.size(); ++i)
    for (const int child : model.nodes[i].children) {
      if (child < 0 || static_cast<std::size_t>(child) >= parents.size())
        throw Error(file + ": no node " + std::to_string(child));
      int& parent = parents[static_cast<std::size_t>(child)];
      if (parent >= 0) throw Error(file + ": " + node_name(model, child) + " has two parents");
      parent = static_cast<int>(i);
    }
  return parents;
}

glm::dmat4 FileNodes::file_from_node(int node) {
  if (parents_.empty()) {
    parents_ = parents_of(model_, file_);
    places_.resize(parents_.size());
  }
  std::vector<std::size_t> above;  // the node and its ancestors, up to one whose place is known
  int at = node;
  while (at >= 0 && !places_[static_cast<std::size_t>(at)]) {
    if (above.size() == parents_.size())
      throw Error(file_ + ": " + node_name(model_, at) + " is its own ancestor");
    above.push_back(static_cast<std::size_t>(at));
    at = parents_[above.back()];
  }
  glm::dmat4 place = at >= 0 ? *places_[static_cast<std::size_t>(at)] : glm::dmat4(1);
  for (auto next = above.rbegin(); next != above.rend(); ++next) {
    const std::string where = file_ + ": " + node_name(model_, static_cast<int>(*next));
    place *= transform_of(model_.nodes[*next], where).parent_from_node;
    places_[*next] = place;
  }
  return place;
}

std::string node_name(const tinygltf::Model& model, int node) {
  const auto index = static_cast<std::size_t>(node);
  return numbered("node", index, model.nodes[index].name);
}

std::vector<PlacedNode> place_nodes(const tinygltf::Model& model,
                                    const std::vector<std::string>& names, const std::string& file,
                                    Notes& notes) {
  struct Visit {
    PlacedNode placed;  // file_from_node is the parent's until the node is visited
    bool is_wanted, is_hidden;
  };
  std::vector<Visit> to_visit;
  const auto push = [&](const std::vector<int>& nodes, const glm::dmat4& parent, NamedTag tag,
                        bool is_wanted, bool is_hidden) {
    for (auto node = nodes.rbegin(); node != nodes.rend(); ++node)
      to_visit.push_back({{*node, parent, tag}, is_wanted, is_hidden});
  };

  std::vector<PlacedNode> placed;
  std::vector<bool> visited(model.nodes.size());
  std::set<std::string> known;
  push(root_nodes(model, file, notes), glm::dmat4(1.0), {}, names.empty(), false);
  while (!to_visit.empty()) {
    Visit visit = to_visit.back();
    to_visit.pop_back();
    const int index = visit.placed.node;
    if (index < 0 || static_cast<std::size_t>(index) >= model.nodes.size())
      throw Error(file + ": no node " + std::to_string(index));
    if (visited[static_cast<std::size_t>(index)])
      throw Error(file + ": " + node_name(model, index) +
                  " has two parents or is its own ancestor");
    visited[static_cast<std::size_t>(index)] = true;
    const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(index)];
    visit.placed.file_from_node *=
        transform_of(node, file + ": " + node_name(model, index)).parent_from_node;
    if (!node.name.empty()) known.insert(node.name);
    if (const NamedTag own = named_tag(node.name); own.part != TagPart::none)
      visit.placed.tag = own;
    const bool is_named = std::find(names.begin(), names.end(), node.name) != names.end();
    const bool is_wanted = visit.is_wanted || is_named;
    bool is_hidden = is_hidden_by_itself(model, index, notes) || visit.is_hidden;
    if (is_hidden && is_named) {
      notes.add(node_name(model, index) +
                ": is hidden by the file (KHR_node_visibility), but named by the object's key "
                "\"nodes\"; shown");
      is_hidden = false;
    }
    if (is_wanted && !is_hidden) placed.push_back(visit.placed);
    push(node.children, visit.placed.file_from_node, visit.placed.tag, is_wanted, is_hidden);
  }

  for (const std::string& name : names) {
    if (known.contains(name)) continue;
    const std::string near = set::nearest(name, {known.begin(), known.end()});
    throw Error(file + ": has no node \"" + set::one_line(name) + "\"" +
                (near.empty() ? std::string() : "; did you mean \"" + set::one_line(near) + "\"?"));
  }
  return placed;
}

}  // namespace previz::scene
