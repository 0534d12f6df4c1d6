// This header defines the scene as data: meshes, instances with presence, materials, textures and
// lights. World space is right-handed, Z up, in metres. Nothing here depends on the GPU or on
// glTF's file format.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <string>
#include <vector>

#include "daemon/core/scene/animation.hpp"
#include "daemon/core/scene/deformation.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::scene {

// The worlds that an instance exists in; also the ray mask. A phantom is in both, a virtual object
// in the mixed world only, a removed real object in the real world only (shaders/README.md,
// "Pairs").
inline constexpr std::uint32_t world_mixed = 1;
inline constexpr std::uint32_t world_real = 2;
inline constexpr std::uint32_t world_both = world_mixed | world_real;

// A mesh is in object space. Its arrays have one entry per vertex; `uvs` is empty where there are
// none (a texture is then read at (0, 0)), and so is `colors`, which then are white. Every vertex
// is finite and used; no triangle has zero area. Normals are unit and, for at least one adjacent
// triangle, on the side of counter-clockwise winding. Of a mesh that deforms that holds before it
// is deformed; positions and normals are those at rest, as the renderer is given it.
struct Mesh {
  std::string name;
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;
  std::vector<glm::vec2> uvs;
  // Texture coordinates of the material's further mappings (Material::mappings), from 1 on.
  std::vector<std::vector<glm::vec2>> more_uvs;
  std::vector<glm::vec4> colors;  // linear, 0..1: factors of the base colour and of the alpha
  // The direction of a texture's +X, unit or 0, and in w 1 or -1, the side of +Y from cross(normal,
  // direction) (glTF 2.0, 3.7.2.1). Empty, and where it is 0: the texture coordinates give both.
  std::vector<glm::vec4> tangents;
  std::vector<glm::uvec3> triangles;  // vertex indices
  Undeformed undeformed;              // empty: the mesh keeps its shape
};

// What a part of a phantom has to do with printed tags, which can be hidden (set::Set::hides_tags).
// The names of glTF nodes say so: "tag 3", "tag3", "tag 3 paper" and "tag 3 print" are `printed`,
// "under tag 3" is `under` it, and so are their children. Exporters put _ for a space, and append
// numbers like .001.
enum class TagPart {
  none,
  printed,  // paper or print: in both worlds; if tags are hidden, in the real one only
  under     // what is shown in its place: in neither world; if tags are hidden, in the mixed one
};

struct NamedTag {
  TagPart part = TagPart::none;
  int id = -1;  // of the tag
};
// Returns what the node of this name is if its object is a phantom.
NamedTag named_tag(const std::string& node);

// world_from_object is finite and invertible. A negative determinant reverses orientation, but the
// front stays where it was in object space (glTF 2.0, 3.7.4): shading and geometric normals go
// through the inverse transpose; a geometric normal computed as a cross product of world space
// edges must be multiplied by the determinant's sign.
struct Instance {
  std::string name;
  std::uint32_t mesh = 0;
  std::uint32_t material = 0;
  std::uint32_t presence = world_both;
  std::uint32_t object = 0;  // index of the set's [[object]] that the instance came from
  glm::dmat4 world_from_object{1.0};
  TagPart tag = TagPart::none;
  int tag_id = -1;  // of a part of a tag
  // The name of the node in the object's file. A node of several primitives has an instance for
  // each, the names of which end with numbers.
  std::string node{};
  // The primitives of one node, or of one of its copies, have a number of their own in an object.
  std::uint32_t placed = 0;
};

// Puts printed tags, and what is under them, into the worlds that they are in when tags are shown
// or hidden.
void hide_tags(std::vector<Instance>& instances, bool hidden);

inline constexpr std::uint32_t no_texture = 0xffffffffu;
inline constexpr std::uint32_t no_object = 0xffffffffu;

inline constexpr std::size_t texture_roles = 13;  // textures that a material can have

// With `mask` a hit counts where alpha >= alpha_cutoff, with `blend` with probability alpha.
enum class AlphaMode : std::uint32_t { opaque, mask, blend };

// A material is glTF 2.0 metallic-roughness with the extensions that the shaders implement. A
// texture multiplies its factor, with the channels that are stated; others mean nothing.
struct Material {
  std::string name;
  glm::vec3 base_color{1};  // linear Rec. 709
  float alpha = 1;          // times the base colour texture's; no meaning where opaque
  float metallic = 0;       // 0..1
  float roughness = 1;      // perceptual, 0..1; alpha = roughness^2
  float specular = 1;       // KHR_materials_specular.specularFactor, 0..1
  // KHR_materials_specular.specularColorFactor, >= 0: factor of the reflectance at normal incidence
  // of paint and plastic
  glm::vec3 specular_color{1};
  float ior = 1.5f;         // KHR_materials_ior, >= 1
  float transmission = 0;   // KHR_materials_transmission, 0..1
  bool thin_walled = true;  // false where KHR_materials_volume gives a thickness > 0
  glm::vec3 emission{0};    // radiance: emissiveFactor * emissive_strength
  std::uint32_t base_color_texture = no_texture;          // RGB, and A of the alpha
  std::uint32_t metallic_roughness_texture = no_texture;  // G roughness, B metallic
  std::uint32_t emission_texture = no_texture;            // RGB
  AlphaMode alpha_mode = AlphaMode::opaque;
  float alpha_cutoff = 0.5f;
  // KHR_materials_volume: after attenuation_distance_m inside, white light has become
  // attenuation_color (Beer-Lambert).
  glm::vec3 attenuation_color{1};
  float attenuation_distance_m = std::numeric_limits<float>::infinity();
  float clearcoat = 0;            // KHR_materials_clearcoat, 0..1: lacquer above all else
  float clearcoat_roughness = 0;  // perceptual, 0..1
  glm::vec3 sheen_color{0};       // KHR_materials_sheen, 0..1: fibres of cloth above the rest
  float sheen_roughness = 0;      // perceptual, 0..1
  // KHR_materials_anisotropy: the strength, 0..1, with which reflections are widened along the
  // texture's +X, and by how much that direction is turned towards its +Y.
  float anisotropy = 0;
  float anisotropy_rotation_rad = 0;
  std::uint32_t normal_texture = no_texture;  // tangent space, +Y up, along the uvs
  float normal_scale = 1;
  std::uint32_t transmission_texture = no_texture;         // R
  std::uint32_t clearcoat_texture = no_texture;            // R
  std::uint32_t clearcoat_roughness_texture = no_texture;  // G
  std::uint32_t sheen_color_texture = no_texture;          // RGB
  std::uint32_t sheen_roughness_texture = no_texture;      // A
  std::uint32_t specular_texture = no_texture;             // A
  std::uint32_t specular_color_texture = no_texture;       // RGB
  // RG: the direction of the anisotropy, from -1 to 1, before it is turned; B the strength.
  std::uint32_t anisotropy_texture = no_texture;
  std::uint32_t clearcoat_normal_texture = no_texture;  // as normal_texture; without it lacquer is
  float clearcoat_normal_scale = 1;                     // as smooth as the mesh
  // By which of the mesh's texture coordinates each texture is read, in the order of
  // material_textures: 0 for Mesh::uvs, which the base colour has, k for Mesh::more_uvs[k - 1].
  std::array<std::uint8_t, texture_roles> mappings{};
};

// The textures that a material can have. The shaders know those from the fifth on by their place
// (LAYER_* of shaders/lib/material_shared.h).
inline constexpr std::array<std::uint32_t Material::*, texture_roles> material_textures = {
    &Material::base_color_texture,
    &Material::metallic_roughness_texture,
    &Material::emission_texture,
    &Material::normal_texture,
    &Material::transmission_texture,
    &Material::clearcoat_texture,
    &Material::clearcoat_roughness_texture,
    &Material::sheen_color_texture,
    &Material::sheen_roughness_texture,
    &Material::specular_texture,
    &Material::specular_color_texture,
    &Material::anisotropy_texture,
    &Material::clearcoat_normal_texture};
inline constexpr std::size_t first_layer_texture = 4;
// A material reads its textures by at most so many different mappings.
inline constexpr std::size_t max_mappings = material_textures.size();

// How an image encodes red, green and blue; alpha is always linear.
enum class Encoding { srgb, linear };

enum class Wrap : std::uint32_t { repeat, clamp, mirror };

// Textures are decoded and linearised: colour from sRGB, data as it is.
struct Texture {
  std::string name;
  int width = 0, height = 0;
  std::vector<glm::vec4> texels;  // row-major, first row is v = 0 (glTF's top)
  Wrap wrap_u = Wrap::repeat, wrap_v = Wrap::repeat;
  bool nearest = false;  // magnification filter
  friend bool operator==(const Texture&, const Texture&) = default;
};

// The looks that an object's file names (KHR_materials_variants). They are loaded with the scene,
// so that changing from one to another loads nothing.
struct Variants {
  struct Look {
    std::uint32_t mesh = 0;  // the instance's, or a copy with other texture coordinates
    std::uint32_t material = 0;
    friend bool operator==(const Look&, const Look&) = default;
  };
  struct Part {
    std::uint32_t instance = 0;
    std::vector<Look> looks;  // without a variant, then in each variant
  };
  std::uint32_t object = 0;        // index of the set's [[object]]
  std::vector<std::string> names;  // not empty; no two are alike
  std::string own;                 // the variant that looks as the file does without one; may be ""
  std::vector<Part> parts;
};

struct Scene {
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  // The lights of the set and of KHR_lights_punctual, in world space. Emissive meshes are not here:
  // the renderer finds them. glTF's photometric numbers are taken as radiometric ones, per channel
  // of linear Rec. 709: candela as W/sr, lux as W/m^2, times the object's lamp_gain. Gains follow
  // the object's presence: virtual (1, 0), phantom (1, 1), removed (0, 1).
  std::vector<set::Light> lights;
  // For each light, the index of the [[object]] whose file it came with; no_object for the set's
  // own lamps, which come last, in the set's order.
  std::vector<std::uint32_t> light_objects;
  // For each light of an object, its intensity in the file: candela, or lux if it is directional.
  std::vector<double> file_intensities;
  std::vector<Animation> animations;      // at most one per object
  std::vector<Deformation> deformations;  // of the meshes whose shape an animation changes
  std::vector<Variants> variants;         // of virtual objects: only they are changed by buttons
  // Notes about what was dropped or not understood while loading, in plain words (counted, never
  // silent).
  std::vector<std::string> notes;
};

// The size of a scene. A mesh counts once, however many instances it has, and not at all if no
// instance shows it.
struct Size {
  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  std::uint64_t texels = 0;               // of all textures
  std::uint64_t instanced_triangles = 0;  // every copy counted
};

// At most this much is loaded; anything larger is refused before it is allocated, and textures are
// made smaller.
inline constexpr std::uint64_t max_triangles = 1ull << 26;  // unique ones; also for vertices
inline constexpr std::uint64_t max_instances = 1ull << 20;
inline constexpr std::uint64_t max_texels = 1ull << 27;  // of all textures together
// Vertices of all morph targets and of all sets of four joints that vertices follow.
inline constexpr std::uint64_t max_deformed = 1ull << 26;
inline constexpr std::uint64_t max_joints = 1ull << 20;  // of the skins of all nodes
inline constexpr int max_texture_side = 16384;
inline constexpr std::uint64_t max_file_bytes = 0xffffffffull;  // glTF binary's own limit

// Returns the looks of the object with this index; null if it has no variants.
const Variants* variants_of(const Scene& scene, std::size_t object);

// Gives the instances of an object the look of a variant; "" is the look that the file has without
// one. Returns false, and changes nothing, if there is no variant of this name.
bool show_variant(const Variants& variants, const std::string& name,
                  std::vector<Instance>& instances);

// Calls `visit(mesh, material)` for every look that an instance of the scene has or can be given.
template <typename Visit>
void for_each_look(const Scene& scene, Visit visit) {
  for (const Instance& instance : scene.instances) visit(instance.mesh, instance.material);
  for (const Variants& variants : scene.variants)
    for (const Variants::Part& part : variants.parts)
      for (const Variants::Look& look : part.looks) visit(look.mesh, look.material);
}

bool emits(const Material& material);

// Returns the mapping by which a material reads one of its textures (Material::mappings).
std::size_t mapping_of(const Material& material, std::uint32_t Material::*texture);

// Returns the mesh's texture coordinates of a mapping; empty where it has none.
const std::vector<glm::vec2>& uvs_of(const Mesh& mesh, std::size_t mapping);

// Returns whether an instance emits, or does in one of its variants.
bool may_glow(const Scene& scene);

// Returns whether any part of this material lets light through: a texture can take metal away.
bool transmits(const Material& material);

// Returns whether the inside of what is made of this material takes light away.
bool attenuates(const Material& material);

// Returns how much of each channel the inside takes away per metre: exp(-result * metres) is left.
// The result is 0 where nothing is taken away or nothing gets in.
glm::vec3 attenuation_per_m(const Material& material);

bool has_sheen(const Material& material);

// Returns whether the reflection of paint or plastic has a colour of its own.
bool has_specular_color(const Material& material);

// Returns whether reflections are wider along one direction. What lets light through is left as it
// is, rough glass in all directions alike.
bool is_anisotropic(const Material& material);

// Returns whether directions on the surface matter: to bumps or to an anisotropy.
bool has_directions(const Material& material);

// Returns whether paint or plastic reflects on any part of this material.
bool has_coat(const Material& material);

// Returns the GGX alpha of reflections at this roughness, in the direction in which they are
// widest, where a texture gives this share of the anisotropy's strength.
double widest_alpha(const Material& material, double roughness, double strength_factor = 1);

// Returns whether any part of this material can be opaque paint or plastic: a texture can take
// metal or glass away.
bool has_opaque_part(const Material& material);

// Returns whether light can leave a surface of this material without blur: clear glass, and metal,
// glass, a coat or lacquer whose GGX alpha is somewhere at or below `specular_alpha`
// (shaders/README.md, "Caustics").
bool can_be_dirac(const Scene& scene, const Material& material, double specular_alpha);

Size size_of(const Scene& scene);

// Returns whether two scenes have the same meshes, which are deformed alike, in as many instances:
// they then have the same trees.
bool have_same_geometry(const Scene& a, const Scene& b);

}  // namespace previz::scene
