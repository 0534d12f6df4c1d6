#include "daemon/core/scene/gltf.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <numbers>
#include <optional>
#include <set>

#include "daemon/core/scene/gltf_animation.hpp"
#include "daemon/core/scene/gltf_deformation.hpp"
#include "daemon/core/scene/gltf_extensions.hpp"
#include "daemon/core/scene/gltf_material.hpp"
#include "daemon/core/scene/gltf_mesh.hpp"
#include "daemon/core/scene/gltf_nodes.hpp"
#include "daemon/core/scene/gltf_read.hpp"
#include "daemon/core/scene/gltf_value.hpp"
#include "daemon/core/scene/gltf_variants.hpp"
#include "daemon/core/scene/seen_backs.hpp"
#include "daemon/core/scene/transform.hpp"
#include "daemon/core/set/problems.hpp"
#include "drivers/error.hpp"

namespace previz::scene {
namespace {

std::uint32_t presence_bits(set::Presence presence) {
  switch (presence) {
    case set::Presence::phantom:
      return world_both;
    case set::Presence::virtual_object:
      return world_mixed;
    case set::Presence::removed:
      return world_real;
  }
  return world_both;
}

// Returns whether the first mappings of a mesh are those that a material wants.
bool begin_alike(const std::vector<UvMapping>& wanted, const std::vector<UvMapping>& of_mesh) {
  return wanted.size() <= of_mesh.size() &&
         std::equal(wanted.begin(), wanted.end(), of_mesh.begin());
}

}  // namespace

// One use of a mesh by a node.
struct MeshUse {
  const Instance& instance;   // the node's
  glm::dmat4 node_from_copy;  // EXT_mesh_gpu_instancing
  bool is_first;              // of the node's copies
  glm::dmat4 world_from_file;
  const NodeDeformation& deforms;
};

struct GltfFile::Loader {
  Loader(const std::filesystem::path& path, Scene& target, Budget& limits)
      : file(path.string()),
        scene(target),
        budget(limits),
        notes(file),
        model(read_gltf(path, notes)),
        materials(model, file, scene, notes, budget),
        variants(model, file, notes),
        file_nodes(model, file) {
    const auto ignored = [&](std::size_t count, const char* what) {
      if (count > 0) notes.add("has " + std::to_string(count) + " " + what + "; ignored");
    };
    ignored(model.cameras.size(), "cameras");
  }

  void add(const set::Object& object, std::uint32_t object_index);
  void add_mesh(const PlacedNode& placed, const MeshUse& use);
  bool add_primitive(const tinygltf::Primitive& primitive, const MeshUse& use,
                     const std::string& name, const std::string& suffix, const std::string& what);
  void add_looks(const tinygltf::Primitive& primitive, const std::vector<int>& worn,
                 const MeshSource& source, const std::string& what);
  void take_tangents(const tinygltf::Primitive& primitive, const std::vector<int>& worn,
                     MeshSource& source);
  void note_missing_uvs(const UsedMaterial& material, const MeshSource& source,
                        const std::string& what);
  void keep_looks(std::uint32_t object_index);
  void note_backs();
  void add_light(const PlacedNode& placed, const glm::dmat4& world_from_node,
                 const set::Object& object);
  std::optional<std::uint32_t> use_mesh(const MeshSource& source, const std::string& name,
                                        const std::string& what);
  std::optional<std::uint32_t> add_deformed(const MeshSource& source, const std::string& name,
                                            const std::string& what,
                                            const NodeDeformation& deforms);

  std::string file;
  Scene& scene;
  Budget& budget;
  Notes notes;
  tinygltf::Model model;
  GltfMaterials materials;
  GltfVariants variants;
  FileNodes file_nodes;
  std::map<MeshSource, std::optional<std::uint32_t>> meshes;  // nothing for an empty mesh
  // Instances that the node added last takes along, and where they are in it.
  std::vector<std::pair<std::uint32_t, glm::dmat4>> carried;
  // These two are of the object that is being added.
  std::size_t look = 0;  // as GltfVariants::look_of()
  std::vector<Variants::Part> parts;
};

void GltfFile::Loader::add(const set::Object& object, std::uint32_t object_index) {
  const std::size_t before = scene.instances.size() + scene.lights.size();
  look = variants.look_of(object.variant);
  parts.clear();
  std::optional<GltfAnimation> played;
  if (!object.animation.empty()) played.emplace(model, object.animation, file, notes);
  Animation animation;
  std::uint32_t count_placed = 0;
  for (const PlacedNode& placed : place_nodes(model, object.nodes, file, notes)) {
    const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(placed.node)];
    Instance instance;
    instance.name = instance.node = node.name;
    instance.presence = presence_bits(object.presence);
    instance.object = object_index;
    if (object.presence == set::Presence::phantom) {
      instance.tag = placed.tag.part;
      instance.tag_id = placed.tag.id;
    }
    instance.world_from_object = object.world_from_file * z_up_from_y_up * placed.file_from_node;
    carried.clear();
    const auto first_light = static_cast<std::uint32_t>(scene.lights.size());
    if (node.mesh >= 0) {
      const std::string where = file + ": " + node_name(model, placed.node);
      if (static_cast<std::size_t>(node.mesh) >= model.meshes.size())
        throw Error(where + ": no mesh " + std::to_string(node.mesh));
      NodeDeformation deforms = read_node_deformation(model, placed.node, where, file_nodes, budget,
                                                      played ? &*played : nullptr, animation.nodes);
      deforms.deformation.object = object_index;
      const std::vector<glm::dmat4> copies = node_from_copies(model, node, where);
      if (deforms.is_skinned && copies.size() > 1)
        notes.add(node_name(model, placed.node) + ": a skin places its mesh; only one of its " +
                  std::to_string(copies.size()) + " copies is kept");
      for (std::size_t i = 0; i < copies.size(); ++i) {
        instance.placed = count_placed++;
        add_mesh(placed,
                 {instance, copies[i], i == 0, object.world_from_file * z_up_from_y_up, deforms});
      }
    }
    add_light(placed, instance.world_from_object, object);
    if (!played) continue;
    const std::uint32_t moved = played->use(placed.node, animation.nodes);
    if (moved == no_node) continue;
    for (const auto& [i, node_from_object] : carried)
      animation.instances.push_back({i, moved, node_from_object});
    for (auto i = first_light; i < scene.lights.size(); ++i)
      animation.lights.push_back({i, moved, glm::dmat4(1)});
  }
  keep_looks(object_index);
  if (!played && !model.animations.empty())
    notes.add("object \"" + set::one_line(object.name) + "\" plays no animation; " +
              list_of_animations(model));
  if (played) {
    animation.object = object_index;
    animation.duration_s = played->duration_s();
    animation.loops = object.loops;
    animation.world_from_file = object.world_from_file * z_up_from_y_up;
    scene.animations.push_back(std::move(animation));
  }
  if (scene.instances.size() + scene.lights.size() == before)
    notes.add("object \"" + set::one_line(object.name) + "\" has nothing visible in it");
}

void GltfFile::Loader::add_mesh(const PlacedNode& placed, const MeshUse& use) {
  const int index = model.nodes[static_cast<std::size_t>(placed.node)].mesh;
  const tinygltf::Mesh& mesh = model.meshes[static_cast<std::size_t>(index)];
  if (mesh.primitives.empty())
    notes.add("mesh " + std::to_string(index) + ": has no primitives; skipped");
  for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
    const tinygltf::Primitive& primitive = mesh.primitives[i];
    const std::string what = numbered("mesh", static_cast<std::size_t>(index), mesh.name) +
                             ", primitive " + std::to_string(i);
    if (primitive.mode >= 0 && primitive.mode < TINYGLTF_MODE_TRIANGLES) {
      notes.add(what + ": points and lines are not supported; skipped");
      continue;
    }
    if (primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN)
      throw Error(file + ": " + what + ": mode " + std::to_string(primitive.mode) +
                  " is not one of glTF's");
    std::string suffix;
    if (mesh.primitives.size() > 1) suffix.append(".").append(std::to_string(i));
    if (!add_primitive(primitive, use, mesh.name, suffix, what)) {
      notes.add(node_name(model, placed.node) +
                ": its transform is singular or not finite; skipped");
      return;
    }
  }
}

// Returns false if the primitive would have no place.
bool GltfFile::Loader::add_primitive(const tinygltf::Primitive& primitive, const MeshUse& use,
                                     const std::string& name, const std::string& suffix,
                                     const std::string& what) {
  const bool is_skinned = follows_joints(primitive, use.deforms);
  if (is_skinned && !use.is_first) return true;  // a skin would put it where the first copy is
  Instance instance = use.instance;
  instance.world_from_object =
      is_skinned ? use.world_from_file : instance.world_from_object * use.node_from_copy;
  if (!is_invertible(instance.world_from_object)) return false;

  const std::vector<int> worn = variants.materials(primitive, what);
  const UsedMaterial material = materials.use(worn.size() > 1 ? worn[look] : worn[0]);
  MeshSource source = mesh_source(primitive, material.mappings);
  take_tangents(primitive, worn, source);
  add_deformation(primitive, use.deforms, file + ": " + what, source);
  note_missing_uvs(material, source, what);
  const auto index = static_cast<std::uint32_t>(scene.instances.size());
  const auto mesh = is_skinned || !source.targets.empty()
                        ? add_deformed(source, name + suffix, what, use.deforms)
                        : use_mesh(source, name + suffix, what);
  if (!mesh) return true;
  budget.add_instance(file);
  instance.name += suffix;
  instance.mesh = *mesh;
  instance.material = material.index;
  if (!is_skinned) carried.emplace_back(index, use.node_from_copy);
  scene.instances.push_back(std::move(instance));
  if (worn.size() > 1 && use.instance.presence == world_mixed)
    add_looks(primitive, worn, source, what);
  return true;
}

// Loads the looks of the instance that was added last. Where a look's texture coordinates differ
// from those of the mesh, it has a copy of the mesh; a mesh that deforms has no copies.
void GltfFile::Loader::add_looks(const tinygltf::Primitive& primitive, const std::vector<int>& worn,
                                 const MeshSource& source, const std::string& what) {
  const auto index = static_cast<std::uint32_t>(scene.instances.size() - 1);
  const Variants::Look own{scene.instances[index].mesh, scene.instances[index].material};
  const bool deforms = !source.targets.empty() || !source.influences.empty();
  Variants::Part& part = parts.emplace_back(Variants::Part{index, {}});
  for (const int material : worn) {
    const UsedMaterial used = materials.use(material);
    Variants::Look look_then{own.mesh, used.index};
    if (!begin_alike(used.mappings, source.mappings)) {
      if (deforms) {
        look_then.material = own.material;
        notes.add(what +
                  ": deforms, and one of its variants maps textures differently; there it "
                  "keeps its own material");
      } else {
        MeshSource mapped = mesh_source(primitive, used.mappings);
        take_tangents(primitive, {material}, mapped);
        const std::string name = scene.meshes[own.mesh].name;
        look_then.mesh = use_mesh(mapped, name, what).value_or(own.mesh);
        note_missing_uvs(used, mapped, what);
      }
    } else if (used.index != own.material) {
      note_missing_uvs(used, source, what);
    }
    part.looks.push_back(look_then);
  }
}

// The tangents matter to bumps and brushed metal only. Without normals they are to be ignored (glTF
// 2.0, 3.7.2.1).
void GltfFile::Loader::take_tangents(const tinygltf::Primitive& primitive,
                                     const std::vector<int>& worn, MeshSource& source) {
  const auto given = primitive.attributes.find("TANGENT");
  if (given == primitive.attributes.end() || source.normals < 0) return;
  if (std::ranges::any_of(worn, [&](int material) {
        return has_directions(scene.materials[materials.use(material).index]);
      }))
    source.tangents = given->second;
}

void GltfFile::Loader::note_missing_uvs(const UsedMaterial& material, const MeshSource& source,
                                        const std::string& what) {
  const auto missing = [&](std::size_t mapping) {
    return what + ": has no TEXCOORD_" + std::to_string(source.mappings[mapping].set);
  };
  for (std::size_t i = 0; i < material.mappings.size(); ++i)
    if (source.uvs[i] < 0) notes.add(missing(i) + " for its textures; they are read at (0, 0)");
  const Material& m = scene.materials[material.index];
  const std::size_t around = mapping_of(m, &Material::anisotropy_texture);
  if (is_anisotropic(m) && source.uvs[around] < 0 && source.tangents < 0)
    notes.add(missing(around) + " for its anisotropy direction; an arbitrary one is used");
}

void GltfFile::Loader::keep_looks(std::uint32_t object_index) {
  if (parts.empty()) return;
  Variants kept{object_index, variants.names(), "", std::move(parts)};
  for (std::size_t i = 0; i < kept.names.size() && kept.own.empty(); ++i)
    if (std::ranges::all_of(kept.parts, [&](const Variants::Part& part) {
          return part.looks[i + 1] == part.looks[0];
        }))
      kept.own = kept.names[i];
  scene.variants.push_back(std::move(kept));
}

// seen_backs.hpp says why it is no more than a note.
void GltfFile::Loader::note_backs() {
  const std::map<std::uint32_t, std::size_t> one_sided = materials.one_sided();
  std::set<std::vector<std::uint32_t>> judged;  // meshes of a node
  std::set<std::size_t> seen;                   // materials of the file
  std::uint64_t tries = 4'000'000;              // as long as reading so many triangles takes
  for (auto first = scene.instances.begin(), last = first; first != scene.instances.end();
       first = last) {
    last = std::find_if(first, scene.instances.end(), [&](const Instance& instance) {
      return instance.object != first->object || instance.placed != first->placed;
    });
    if (first->presence != world_mixed) continue;
    std::vector<std::uint32_t> meshes_of_node;
    std::vector<const Mesh*> surfaces;
    bool is_new = false;
    for (auto instance = first; instance != last; ++instance) {
      meshes_of_node.push_back(instance->mesh);
      surfaces.push_back(&scene.meshes[instance->mesh]);
      const auto at = one_sided.find(instance->material);
      is_new |= at != one_sided.end() && !seen.contains(at->second);
    }
    if (!is_new || !judged.insert(meshes_of_node).second) continue;
    const std::vector<bool> behind = are_seen_from_behind(surfaces, tries);
    for (std::size_t i = 0; i < behind.size(); ++i) {
      const auto at = one_sided.find(first[static_cast<std::ptrdiff_t>(i)].material);
      if (behind[i] && at != one_sided.end()) seen.insert(at->second);
    }
  }
  if (!seen.empty())
    notes.add("its one-sided faces are shown from behind, too, where glTF hides them" +
              in_brackets(model, {seen.begin(), seen.end()}));
}

// Every instance of a mesh that deforms has a mesh of its own.
std::optional<std::uint32_t> GltfFile::Loader::add_deformed(const MeshSource& source,
                                                            const std::string& name,
                                                            const std::string& what,
                                                            const NodeDeformation& deforms) {
  std::optional<Mesh> mesh = read_mesh(model, source, file + ": " + what, what, notes, budget);
  if (!mesh) return {};
  mesh->name = name;
  DeformedVertices at_rest = deformed(mesh->undeformed, shape_at_rest(deforms.deformation));
  mesh->positions = std::move(at_rest.positions);
  mesh->normals = std::move(at_rest.normals);
  const bool moves = (!source.influences.empty() && deforms.is_skin_moved) ||
                     (!source.targets.empty() && deforms.are_weights_moved);
  if (!moves && !keep_shape(*mesh, what, notes)) return {};
  Deformation deformation = deforms.deformation;
  if (moves) deformation.extent = extent_of(mesh->undeformed);
  if (!has_usable_positions(*mesh) ||
      (moves && !can_be_shown(shape_at_rest(deformation), deformation.extent)))
    throw Error(file + ": " + what + ": its joints or targets move vertices beyond 1e15 at rest");
  const auto index = static_cast<std::uint32_t>(scene.meshes.size());
  scene.meshes.push_back(std::move(*mesh));
  if (!moves) return index;
  deformation.mesh = index;
  deformation.instance = static_cast<std::uint32_t>(scene.instances.size());
  scene.deformations.push_back(std::move(deformation));
  return index;
}

std::optional<std::uint32_t> GltfFile::Loader::use_mesh(const MeshSource& source,
                                                        const std::string& name,
                                                        const std::string& what) {
  const auto [at, is_new] = meshes.try_emplace(source);
  if (!is_new) return at->second;
  std::optional<Mesh> mesh = read_mesh(model, source, file + ": " + what, what, notes, budget);
  if (!mesh) return {};
  mesh->name = name;
  at->second = static_cast<std::uint32_t>(scene.meshes.size());
  scene.meshes.push_back(std::move(*mesh));
  return at->second;
}

// KHR_lights_punctual: a light shines along its node's -Z; scale does not change it.
void GltfFile::Loader::add_light(const PlacedNode& placed, const glm::dmat4& world_from_node,
                                 const set::Object& object) {
  const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(placed.node)];
  const double index = number(extension(node.extensions, "KHR_lights_punctual"), "light", -1);
  if (index < 0) return;
  const std::string where = node_name(model, placed.node);
  if (index >= static_cast<double>(model.lights.size()))
    throw Error(file + ": " + where + ": no light " +
                std::to_string(static_cast<std::int64_t>(std::min(index, 1e15))));
  const tinygltf::Light& given = model.lights[static_cast<std::size_t>(index)];
  const std::string what = where + ": its light";

  set::Light light;
  light.name = given.name.empty() ? node.name : given.name;
  light.position = glm::dvec3(world_from_node[3]);
  light.direction = -glm::dvec3(world_from_node[2]);
  const double length = glm::length(light.direction);
  if (!is_finite(world_from_node) || !(length > 0) || !std::isfinite(length)) {
    notes.add(what + " has a transform that is singular or not finite; skipped");
    return;
  }
  light.direction /= length;
  if (given.type == "point") {
    light.type = set::LightType::point;
  } else if (given.type == "directional") {
    light.type = set::LightType::directional;
  } else if (given.type == "spot") {
    light.type = set::LightType::spot;
    const double widest = std::numbers::pi / 2;
    light.outer_cone_rad =
        within(given.spot.outerConeAngle, 1e-4, widest, what + "'s outer cone", notes);
    light.inner_cone_rad =
        within(given.spot.innerConeAngle, 0, light.outer_cone_rad, what + "'s inner cone", notes);
  } else {
    notes.add(what + " is of the unknown type \"" + set::one_line(given.type) + "\"; skipped");
    return;
  }
  const std::vector<double> color =
      given.color.size() == 3 ? given.color : std::vector<double>{1, 1, 1};
  for (int i = 0; i < 3; ++i)
    light.emission[i] =
        within(color[static_cast<std::size_t>(i)] * given.intensity * object.lamp_gain, 0, 1e30,
               what + "'s colour or intensity", notes);
  if (given.range > 0) notes.add(what + "'s range is ignored: light falls off with the square");
  const std::uint32_t presence = presence_bits(object.presence);
  light.gain_mixed = (presence & world_mixed) != 0 ? 1 : 0;
  light.gain_real = (presence & world_real) != 0 ? 1 : 0;
  scene.lights.push_back(std::move(light));
  scene.file_intensities.push_back(given.intensity);
}

GltfFile::GltfFile(const std::filesystem::path& file, Scene& scene, Budget& budget)
    : loader_(std::make_unique<Loader>(file, scene, budget)) {}
GltfFile::~GltfFile() = default;

void GltfFile::add(const set::Object& object, std::uint32_t index) {
  loader_->add(object, index);
}

void GltfFile::finish() {
  loader_->materials.decode_textures();
  loader_->note_backs();
}

std::vector<std::string> GltfFile::notes() const {
  return loader_->notes.lines();
}

}  // namespace previz::scene
