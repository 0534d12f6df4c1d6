// Reads glTF materials: metallic-roughness and the KHR_materials_* extensions that scene.hpp's
// Material has.
#pragma once

#include <tiny_gltf.h>

#include <cstdint>
#include <string>
#include <unordered_map>

#include "daemon/scene/gltf_mesh.hpp"
#include "daemon/scene/gltf_texture.hpp"
#include "daemon/scene/load_log.hpp"
#include "daemon/scene/scene.hpp"

namespace previz::scene {

// A material in the scene, and how a mesh that uses it must transform its texture coordinates. A
// mesh has one set of coordinates: textures whose mapping differs from that of the first (base
// colour, metallic-roughness, emission, normal, in this order) are left out with a note.
struct UsedMaterial {
  std::uint32_t index = 0;  // in Scene::materials
  UvMapping mapping;
  bool is_textured = false;
};

// Holds the materials of one file, each created when first used.
class GltfMaterials {
 public:
  GltfMaterials(const tinygltf::Model& model, std::string file, Scene& scene, Notes& notes,
                Budget& budget)
      : model_(model),
        file_(file),
        scene_(scene),
        notes_(notes),
        textures_(model, std::move(file), scene, notes, budget) {}

  // Material -1 is glTF's default. Throws previz::Error if the material, its texture or an image
  // does not exist.
  UsedMaterial use(int material);

 private:
  UsedMaterial read(const tinygltf::Material& given, const std::string& what);
  void read_extensions(const tinygltf::Material& given, const std::string& what,
                       Material& material);
  void read_sheen(const tinygltf::Material& given, const std::string& what, Material& material);
  void read_anisotropy(const tinygltf::Material& given, const std::string& what,
                       Material& material);

  const tinygltf::Model& model_;
  std::string file_;
  Scene& scene_;
  Notes& notes_;
  GltfTextures textures_;
  std::unordered_map<int, UsedMaterial> used_;
};

}  // namespace previz::scene
