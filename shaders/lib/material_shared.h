// The renderer's features and the materials, which cross between C++ and the shaders, in scalar
// layout. An extension of materials that is a layer has its bit, its textures and its factors here;
// daemon/core/scene/material_extensions.cpp has all that only C++ knows of it.
#ifndef PREVIZ_MATERIAL_SHARED_H
#define PREVIZ_MATERIAL_SHARED_H

#include "shaders/lib/shared.h"

#ifdef __cplusplus
#include <cstddef>
namespace previz::gpu {
#endif

// Features that a scene may require. Specialisation constant 0 is their union; a feature that is
// left out changes no pixel.
PREVIZ_CONST uint FEATURE_GLOSSY = 1u;        // any specular reflection of opaque surfaces
PREVIZ_CONST uint FEATURE_TRANSMISSION = 2u;
PREVIZ_CONST uint FEATURE_TEXTURES = 4u;
PREVIZ_CONST uint FEATURE_LIGHTS = 8u;        // set lights or emissive triangles
PREVIZ_CONST uint FEATURE_VISIBLE_LIGHTS = 16u;  // lights with an extent that rays can see
PREVIZ_CONST uint FEATURE_LENS = 32u;
PREVIZ_CONST uint FEATURE_FORKS = 64u;        // any object that is in one world only
PREVIZ_CONST uint FEATURE_ENVIRONMENT_SAMPLING = 128u;  // next-event estimation of the environment
PREVIZ_CONST uint FEATURE_CAUSTICS = 256u;  // paths bring caustics
PREVIZ_CONST uint FEATURE_PHOTONS = 512u;   // photons bring caustics
PREVIZ_CONST uint FEATURE_NORMAL_MAPS = 2048u;
PREVIZ_CONST uint FEATURE_ALPHA = 4096u;  // any surface that may be transparent by its alpha
PREVIZ_CONST uint FEATURE_DIFFERENCE = 1024u;  // where possible, only the difference is traced
PREVIZ_CONST uint FEATURE_PANES = 16384u;  // any smooth thin wall through which light goes straight
PREVIZ_CONST uint FEATURE_CAMERA = 8192u;  // the plate gives the radiance of points that it shows
PREVIZ_CONST uint FEATURE_ATTENUATION = 32768u;  // clear solids that take light away inside
PREVIZ_CONST uint FEATURE_CLEARCOAT = 65536u;  // a coat of lacquer above the base material
PREVIZ_CONST uint FEATURE_MANY_LIGHTS = 131072u;  // more than FEW_LIGHTS: they are chosen by a tree
PREVIZ_CONST uint FEATURE_SHEEN = 262144u;        // fibres of cloth above the base material
PREVIZ_CONST uint FEATURE_ANISOTROPY = 524288u;   // reflections that are wider along one direction
PREVIZ_CONST uint FEATURE_COAT_COLOR = 1048576u;  // paint or plastic whose reflection has a colour
PREVIZ_CONST uint FEATURE_FILTERED_TEXTURES = 2097152u;  // looked up over a sample's footprint
PREVIZ_CONST uint FEATURE_VERTEX_COLORS = 4194304u;   // base colours that meshes state
PREVIZ_CONST uint FEATURE_MAPPINGS = 8388608u;        // textures of a surface that lie differently on it
PREVIZ_CONST uint FEATURE_LAYER_TEXTURES = 16777216u;  // textures of glass, gloss, lacquer and sheen
PREVIZ_CONST uint FEATURE_TANGENTS = 33554432u;        // directions on surfaces that meshes state

// The lobe of smoother sheen is narrower than its table resolves.
PREVIZ_CONST float LEAST_SHEEN_ROUGHNESS = 0.07f;

// The textures of a material, by their place in scene::material_textures: the first four have names
// of their own in GpuMaterial, the others are its layer_textures, here from 0 on.
PREVIZ_CONST uint TEXTURE_OF_BASE_COLOR = 0u;
PREVIZ_CONST uint TEXTURE_OF_METALLIC_ROUGHNESS = 1u;
PREVIZ_CONST uint TEXTURE_OF_EMISSION = 2u;
PREVIZ_CONST uint TEXTURE_OF_NORMAL = 3u;
PREVIZ_CONST uint TEXTURE_OF_LAYERS = 4u;
PREVIZ_CONST uint LAYER_TRANSMISSION = 0u;
PREVIZ_CONST uint LAYER_CLEARCOAT = 1u;
PREVIZ_CONST uint LAYER_CLEARCOAT_ROUGHNESS = 2u;
PREVIZ_CONST uint LAYER_SHEEN_COLOR = 3u;
PREVIZ_CONST uint LAYER_SHEEN_ROUGHNESS = 4u;
PREVIZ_CONST uint LAYER_SPECULAR = 5u;
PREVIZ_CONST uint LAYER_SPECULAR_COLOR = 6u;
PREVIZ_CONST uint LAYER_ANISOTROPY = 7u;
PREVIZ_CONST uint LAYER_CLEARCOAT_NORMAL = 8u;
PREVIZ_CONST uint LAYERS = 9u;

// The textures that multiply a factor: place, the factor in Surface, and the channels that it is
// multiplied by. C++ names the texture <factor>_texture.
#define PREVIZ_LAYER_TEXTURES(X)                      \
  X(LAYER_TRANSMISSION, transmission, r)              \
  X(LAYER_CLEARCOAT, clearcoat, r)                    \
  X(LAYER_CLEARCOAT_ROUGHNESS, clearcoat_roughness, g) \
  X(LAYER_SHEEN_COLOR, sheen_color, rgb)              \
  X(LAYER_SHEEN_ROUGHNESS, sheen_roughness, a)        \
  X(LAYER_SPECULAR, specular, a)                      \
  X(LAYER_SPECULAR_COLOR, specular_color, rgb)

// The factors of layers, which GpuMaterial and Surface both have: type, name, the feature that reads
// it, and its value without the feature.
//   clearcoat        weight of a coat of lacquer above all else
//   sheen_color      of fibres above the base material; black: there are none
//   sheen_roughness  at least LEAST_SHEEN_ROUGHNESS
//   specular_color   factor of the coat's reflectance at normal incidence
#define PREVIZ_LAYER_FACTORS(X)                              \
  X(float, clearcoat, FEATURE_CLEARCOAT, 0.0)                \
  X(float, clearcoat_roughness, FEATURE_CLEARCOAT, 0.0)      \
  X(vec3, sheen_color, FEATURE_SHEEN, vec3(0.0))             \
  X(float, sheen_roughness, FEATURE_SHEEN, 1.0)              \
  X(vec3, specular_color, FEATURE_COAT_COLOR, vec3(1.0))

#define PREVIZ_FACTOR_MEMBER(type, name, feature, otherwise) type name;

struct GpuMaterial {
  vec3 base_color;
  float metallic;
  vec3 emission;
  float roughness;
  float specular;
  float ior;
  float transmission;
  uint thin_walled;
  uint base_color_texture;  // NO_INDEX: none
  uint metallic_roughness_texture;
  uint emission_texture;
  uint normal_texture;
  float normal_scale;
  uint alpha_mode;    // ALPHA_*
  float alpha;
  float alpha_cutoff;
  uint albedo_table;  // rough glass: its table seen from outside; the next is from inside.
                      // Anisotropic metal: the first of its ANISOTROPIC_TABLES
  vec3 attenuation;   // inside, per metre; 0: clear, or nothing gets in
  PREVIZ_LAYER_FACTORS(PREVIZ_FACTOR_MEMBER)
  vec2 anisotropy;      // in which direction of the texture the reflection is wider, times the
                        // strength; 0: in none
  uint layers;          // bit i: it has layer_textures[i]
  uint layer_textures[LAYERS];
  uint mappings[2];     // of every texture, of 4 bits each: by mapping_of()
  float clearcoat_normal_scale;
  uint anisotropy_steps;  // of ANISOTROPIC_TABLES from albedo_table on; 0: they are of one strength
  uint padding[3];
};

// glTF's alpha modes: the surface is all there, or there where its alpha reaches the cutoff, or its
// alpha is the share that is there.
PREVIZ_CONST uint ALPHA_OPAQUE = 0u;
PREVIZ_CONST uint ALPHA_MASK = 1u;
PREVIZ_CONST uint ALPHA_BLEND = 2u;

#ifdef __cplusplus
static_assert(sizeof(GpuMaterial) == 208);  // of MATERIAL_TEXELS (shaders/lib/records.glsl)
static_assert(offsetof(GpuMaterial, base_color_texture) == 48);
static_assert(offsetof(GpuMaterial, albedo_table) == 80);
static_assert(offsetof(GpuMaterial, layer_textures) == 16 * 9);
static_assert(offsetof(GpuMaterial, mappings) == 180);
}  // namespace previz::gpu
#endif
#endif
