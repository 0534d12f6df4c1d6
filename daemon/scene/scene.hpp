// The scene as data: meshes, instances with presence, materials, textures and lights. World space
// is right-handed, Z up, metres. No GPU and no glTF in here.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "daemon/set/set.hpp"

namespace previz::scene {

// The worlds an instance exists in; also the ray mask. A phantom is both, a virtual object mixed
// only, a removed real object real only.
inline constexpr std::uint32_t world_mixed = 1;
inline constexpr std::uint32_t world_real = 2;
inline constexpr std::uint32_t world_both = world_mixed | world_real;

// Object space. All three arrays have one entry a vertex; `uvs` is empty where there are none.
// Normals are unit and on the side of counter-clockwise winding.
struct Mesh {
  std::string name;
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;
  std::vector<glm::vec2> uvs;
  std::vector<glm::uvec3> triangles;  // vertex indices
};

struct Instance {
  std::string name;
  std::uint32_t mesh = 0;
  std::uint32_t material = 0;
  std::uint32_t presence = world_both;
  std::uint32_t object = 0;  // index of the set's [[object]] it came from
  glm::dmat4 world_from_object{1.0};
};

inline constexpr std::uint32_t no_texture = 0xffffffffu;

// glTF 2.0 metallic-roughness with the extensions the shaders implement.
struct Material {
  std::string name;
  glm::vec3 base_color{1};       // linear Rec. 709
  float alpha = 1;
  float metallic = 0;            // 0..1
  float roughness = 1;           // perceptual, 0..1; alpha = roughness^2
  float specular = 1;            // KHR_materials_specular.specularFactor, 0..1
  float ior = 1.5f;              // KHR_materials_ior, >= 1
  float transmission = 0;        // KHR_materials_transmission, 0..1
  bool thin_walled = true;       // false where KHR_materials_volume gives a thickness > 0
  bool double_sided = false;
  glm::vec3 emission{0};         // radiance: emissiveFactor * emissive_strength
  std::uint32_t base_color_texture = no_texture;
  std::uint32_t metallic_roughness_texture = no_texture;  // G roughness, B metallic
  std::uint32_t emission_texture = no_texture;
};

enum class Wrap : std::uint32_t { repeat, clamp, mirror };

// Decoded and linearised (colour textures from sRGB; data textures as they are).
struct Texture {
  std::string name;
  int width = 0, height = 0;
  std::vector<glm::vec4> texels;  // row-major, first row is v = 0 (glTF's top)
  Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  bool nearest = false;  // magnification filter
};

struct Scene {
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  // Of the set and of KHR_lights_punctual, in world space. Emissive meshes are not here: the
  // renderer finds them.
  std::vector<set::Light> lights;
  // What was dropped or not understood while loading, in plain words (counted, never silent).
  std::vector<std::string> notes;
};

// What the scene needs of the renderer; what it does not need is left out of the pipelines.
struct Requirements {
  bool transmission = false;
  bool metals = false;            // any conductor
  bool rough_specular = false;    // any GGX lobe above the specular threshold
  bool textures = false;
  bool alpha = false;
  bool emissive_meshes = false;
  bool lights = false;
  bool differing_objects = false; // any instance present in one world only
  bool removed_objects = false;
  bool thin_lens = false;
  std::uint64_t triangles = 0;            // unique
  std::uint64_t instanced_triangles = 0;  // as seen by rays
};

// Loads every object of the set. Throws previz::Error naming the file and what is wrong in it;
// what can be left out (zero-area and NaN triangles, unknown extensions) goes into Scene::notes.
Scene load_scene(const set::Set& set);

// What the scene, with this lens, needs.
Requirements requirements(const Scene& scene, const set::Set& set);

}  // namespace previz::scene
