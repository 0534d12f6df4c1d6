// Reads glTF materials: metallic-roughness and the extensions that material_extensions.hpp says are
// read.
//
// KHR_materials_pbrSpecularGlossiness, where a material has it, takes the place of
// metallic-roughness: its diffuse colour is the base colour, its specular colour the reflectance of
// paint at normal incidence (KHR_materials_specular), and the roughness 1 - glossiness. That is its
// own model, of metals, too: black paint whose reflectance has the colour of gold. A conversion to
// `metallic` would have to guess which of both a surface is, and has no value for what lies between
// them. Below 0.04 the reflectance at grazing angles falls to 0 with it, so that no specular colour
// is no reflection.
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>

#include "daemon/core/scene/gltf_mesh.hpp"
#include "daemon/core/scene/gltf_texture.hpp"
#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/material_extensions.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// A material in the scene, and how its textures are mapped onto a mesh that uses it: the mesh has
// texture coordinates of each mapping, to which Material::mappings counts. There is none if it has
// no texture.
struct UsedMaterial {
  std::uint32_t index = 0;  // in Scene::materials
  std::vector<UvMapping> mappings;
};

// The texture that shows a surface as it looks in even light: that of the base colour, else of the
// diffuse colour (KHR_materials_pbrSpecularGlossiness), else of the emission.
struct LookTexture {
  int texture = -1;  // -1: none
  UvMapping mapping;
};
LookTexture look_texture(const tinygltf::Material& material, const std::string& what, Notes& notes);

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

  // Returns the materials used so far whose back glTF hides: from the index in the scene to that in
  // the file. What lets light through is seen from both sides.
  std::map<std::uint32_t, std::size_t> one_sided() const;

  // Decodes the textures of the materials used so far (GltfTextures::decode()).
  void decode_textures() { textures_.decode(); }

 private:
  class Textures;

  UsedMaterial read(const tinygltf::Material& given, const std::string& what);
  void read_extension(const MaterialExtension& extension, const tinygltf::Material& given,
                      const std::string& what, Textures& textures, Material& material);

  const tinygltf::Model& model_;
  std::string file_;
  Scene& scene_;
  Notes& notes_;
  GltfTextures textures_;
  std::unordered_map<int, UsedMaterial> used_;
};

}  // namespace previz::scene
