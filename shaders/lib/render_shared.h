// Structures of the renderer that cross between C++ and the shaders, with their layout (scalar).
// What tracing needs is in shared.h.
#ifndef PREVIZ_RENDER_SHARED_H
#define PREVIZ_RENDER_SHARED_H

#include "shaders/lib/shared.h"

#ifdef __cplusplus
#include <cstddef>
namespace previz::gpu {
#endif

// A table of daemon/render/albedo_table.hpp has this many texels on each side.
PREVIZ_CONST uint ALBEDO_SIDE = 32u;
// Glass below this index bends light too little for its roughness to show; it is taken as smooth.
PREVIZ_CONST float LEAST_ROUGH_IOR = 1.001f;

PREVIZ_CONST uint TEXELS_PER_PHOTON = 4u;

// Pixels from which the variance of a single sample is taken, to each side.
PREVIZ_CONST uint DENOISE_VARIANCE_REACH = 3u;
// A channel that comes out at this share of the sensor's white is white: a step of 8 bits below it.
PREVIZ_CONST float NEARLY_WHITE = 0.99f;

// How the difference is put onto the camera's picture: set::Composite.
PREVIZ_CONST uint COMPOSITE_ADDITIVE = 0u;
PREVIZ_CONST uint COMPOSITE_RATIO = 1u;
PREVIZ_CONST uint COMPOSITE_HYBRID = 2u;

// What a slot holds, in the fourth component of its sample_real.
PREVIZ_CONST float SAMPLE_FULL = 0.0f;        // both radiances
PREVIZ_CONST float SAMPLE_DIFFERENCE = 1.0f;  // only what differs between them

// Sides of the blocks of pixels that get the same number of samples.
PREVIZ_CONST uint SAMPLED_BLOCK = 8u;
PREVIZ_CONST uint UNLIMITED = 0xffffffffu;

PREVIZ_CONST uint WORKGROUP_SIZE = 64u;
PREVIZ_CONST uint NO_INDEX = 0xffffffffu;
PREVIZ_CONST uint MAX_DEPTH = 64u;

// What the scene requires; specialisation constant 0. A feature left out changes no pixel.
PREVIZ_CONST uint FEATURE_GLOSSY = 1u;        // any specular reflection of opaque surfaces
PREVIZ_CONST uint FEATURE_TRANSMISSION = 2u;
PREVIZ_CONST uint FEATURE_TEXTURES = 4u;
PREVIZ_CONST uint FEATURE_LIGHTS = 8u;        // set lights or emissive triangles
PREVIZ_CONST uint FEATURE_VISIBLE_LIGHTS = 16u;  // lights with an extent that rays can see
PREVIZ_CONST uint FEATURE_LENS = 32u;
PREVIZ_CONST uint FEATURE_FORKS = 64u;        // any object present in one world only
PREVIZ_CONST uint FEATURE_ENVIRONMENT_SAMPLING = 128u;  // next-event estimation of the environment
PREVIZ_CONST uint FEATURE_CAUSTICS = 256u;  // paths bring light to rough vertices by Dirac lobes only
PREVIZ_CONST uint FEATURE_PHOTONS = 512u;   // photons bring it
PREVIZ_CONST uint FEATURE_NORMAL_MAPS = 2048u;
PREVIZ_CONST uint FEATURE_ALPHA = 4096u;  // any surface that is not there everywhere
PREVIZ_CONST uint FEATURE_DIFFERENCE = 1024u;  // only what differs is traced, where that is enough
PREVIZ_CONST uint FEATURE_CAMERA = 8192u;  // the plate is the real radiance of points it shows

// Bits of a path's state.
PREVIZ_CONST uint PATH_WORLDS_MASK = 3u;      // WORLD_*
PREVIZ_CONST uint PATH_DEPTH_SHIFT = 8u;      // number of surface vertices so far
PREVIZ_CONST uint PATH_ROUGH = 4u;            // some vertex so far scattered by a non-Dirac lobe
PREVIZ_CONST uint PATH_DIFFERENCE = 8u;       // while in both worlds, only what differs counts
PREVIZ_CONST uint PATH_LANDED = 16u;          // was in the mixed world, took the plate's radiance and
                                              // goes on for Lm - Lr there

struct GpuHit {
  float t;  // < 0: nothing hit
  vec2 barycentrics;
  uint instance;
  uint primitive;
};

struct GpuShadowRay {
  vec3 origin;
  float t_max;
  vec3 direction;
  uint slot_and_worlds;  // slot << 3 | landed << 2 | WORLD_*
  vec3 contribution;     // throughput * f * cos * Le / pdf * MIS weight
  vec2 gain;             // emission gain in the (mixed, real) world
};

// Light that arrived at a surface with a non-Dirac lobe by way of Dirac lobes only.
struct GpuPhoton {
  vec3 position;
  uint vertices;   // Dirac vertices on its way; 0: it did not stay anywhere
  vec3 direction;  // in which it travelled, unit
  vec3 normal;     // geometric, on the side on which it arrived
  vec3 flux;       // watts; divided by the number of photons of the pass
  vec2 gain;       // in the (mixed, real) world
};

struct GpuPhotonBucket {
  uint first;  // in photon_order
  uint count;
};

struct GpuPhotonControl {
  uint stored;
};

// What one pixel has gathered: two-float sums (value = high + low), so that 1e7 samples stay exact.
struct GpuPixel {
  vec4 mixed_high;  // Lm, M
  vec4 mixed_low;
  vec4 diff_high;   // Lm - Lr, depth
  vec4 diff_low;
  vec4 normal;      // sum of normals, number of samples that hit something
  vec4 square_mixed_high;  // sums of squares, for the variance; w: samples of the difference only
  vec4 square_mixed_low;
  vec4 square_diff_high;   // w: number of samples
  vec4 square_diff_low;
};

// The real world's first surface at the middle of a pixel.
struct GpuSeen {
  float inverse_depth;  // 1/m, along the optical axis; 0: none, or one that alpha lets through
  uint instance;
};

struct GpuControl {
  uint extend_groups[4];  // indirect dispatch arguments (x, y, z), padding
  uint shadow_groups[4];
  uint active_count;      // paths in the queue being worked on
  uint next_count;        // paths appended for the next segment
  uint shadow_count;
  uint queue_side;        // which half of the queue is active
  uint rays_low, rays_high;
  uint shadow_rays_low, shadow_rays_high;
  uint dropped_not_finite;
  uint dropped_negative;
  uint stopped_in_layers;
  uint measured_low, measured_high;      // vertices whose radiance the plate gave
  uint unmeasured_low, unmeasured_high;  // and those of the real world for which it could not
};

struct GpuInstance {
  vec4 world_from_object[3];  // rows; camera-relative world
  vec4 object_from_world[3];
  uint material;
  uint first_triangle;  // in triangles
  uint first_light;     // of its emissive triangles; NO_INDEX: emits nothing
  uint presence;
};

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
  uint albedo_table;  // rough glass: of albedo, seen from outside; the next one is from inside
};

// glTF's alpha modes: all there; there where alpha reaches the cutoff; there by a share of alpha.
PREVIZ_CONST uint ALPHA_OPAQUE = 0u;
PREVIZ_CONST uint ALPHA_MASK = 1u;
PREVIZ_CONST uint ALPHA_BLEND = 2u;

PREVIZ_CONST uint TEXTURE_REPEAT = 0u;
PREVIZ_CONST uint TEXTURE_CLAMP = 1u;
PREVIZ_CONST uint TEXTURE_MIRROR = 2u;

struct GpuTexture {
  uint first_texel;
  uint width, height;
  uint wrap_u, wrap_v;
  uint nearest;
};

PREVIZ_CONST uint LIGHT_POINT = 0u;
PREVIZ_CONST uint LIGHT_SPOT = 1u;
PREVIZ_CONST uint LIGHT_DIRECTIONAL = 2u;
PREVIZ_CONST uint LIGHT_RECTANGLE = 3u;
PREVIZ_CONST uint LIGHT_SPHERE = 4u;
PREVIZ_CONST uint LIGHT_TRIANGLE = 5u;

// Camera-relative world space.
struct GpuLight {
  vec3 position;   // point, spot, sphere centre, rectangle centre, triangle's first vertex
  uint type;
  vec3 direction;  // the way light travels; triangle: unit normal
  float radius;    // sphere
  vec3 edge_u;     // rectangle: whole width; triangle: v1 - v0
  float cos_inner; // spot
  vec3 edge_v;     // rectangle: whole height; triangle: v2 - v0
  float cos_outer; // spot
  vec3 emission;   // intensity, irradiance (directional delta) or radiance
  float cone_sr;   // directional: solid angle of its disc, 0 for a delta light
  vec2 gain;       // (mixed, real)
  float selection; // probability that a light sample picks this light
  float cdf;       // sum of selection up to and including this light
  vec2 uv0, uv1, uv2;  // triangle: texture coordinates
  uint emission_texture;
  uint alpha_material;  // triangle: whose alpha weakens it; NO_INDEX: it is all there
};

struct GpuFrame {
  vec4 world_from_camera[3];  // rows of the rotation; the camera is the origin
  uint width, height;
  float lens_radius;          // metres; 0: pinhole
  float focus_distance;       // metres along the axis
  uint seed;
  uint max_depth;
  uint roulette_depth;
  float specular_alpha;       // alpha at or below which a lobe is a Dirac delta
  uint environment_size;
  uint environment_levels;    // of importance
  float environment_selection;  // probability that a light sample picks the environment
  uint light_count;
  uint visible_light_count;   // the first lights, those with an extent that are not triangles
  uint bound_count;
  float bound_share;          // of a shared path's directions, at most, towards those bounds
  float environment_spread;   // solid angle over 2 pi that light samples find its light in
  float lamp_spread;          // the same of the lights
  float lamp_part;            // of all light, that of the lights
  float difference_roulette;  // survival of a path of the difference over the bounds' solid angle
  uint specular_bound_count;  // the bounds after them
  uint photon_count;          // emitted a pass
  float photon_environment;   // probability that a photon starts from the environment
  vec3 scene_center;
  float scene_radius;         // of a sphere that holds everything
  vec2 focal_px, principal_px;  // of the observer's lens, OpenCV's convention
  vec3 radial;                  // k1, k2, k3
  vec2 tangential;              // p1, p2
};

// Push constants: the part of the picture and the samples of this batch.
struct GpuBatch {
  uint x, y, width, height;   // tile
  uint first_sample, samples;
  float photon_radius;        // metres; photons of a pass serve the sample of the same index
};

// Push constants of the passes that take noise out.
struct GpuDenoise {
  uint width, height;
  uint step;           // pixels between neighbours
  uint single_sample;  // 1: what a pixel has is one sample, and its variance is not known
};

// Push constants of the passes that make what is shown: pixels of a band.
struct GpuShow {
  uint count;
  uint in_tile;        // the first of them among the tile's
  uint in_band;        // and among the band's
  uint has_plate;      // 0: over black
  uint most;           // the largest code
  uint composite;      // COMPOSITE_*
  float floor;         // of COMPOSITE_HYBRID, radiance
  float exposure;      // signal over radiance
  float white;         // radiance at which the sensor clips, 1 / exposure
  float most_variance; // radiance squared
  uint is_denoised;    // the signals are: the composite's place is theirs
};

#ifdef __cplusplus
static_assert(sizeof(GpuDenoise) == 16);
static_assert(sizeof(GpuShow) == 44);
static_assert(sizeof(GpuHit) == 20);
static_assert(sizeof(GpuShadowRay) == 52);
static_assert(sizeof(GpuPixel) == 144);
static_assert(sizeof(GpuControl) == 92);
static_assert(sizeof(GpuInstance) == 112);
static_assert(sizeof(GpuMaterial) == 84);
static_assert(offsetof(GpuMaterial, base_color_texture) == 48);
static_assert(sizeof(GpuTexture) == 24);
static_assert(sizeof(GpuLight) == 128);
static_assert(offsetof(GpuLight, uv0) == 96);
static_assert(sizeof(GpuFrame) == 188);
static_assert(sizeof(GpuBatch) == 28);
static_assert(sizeof(GpuPhoton) == 60);
static_assert(sizeof(GpuPhotonBucket) == 8);
}  // namespace previz::gpu
#endif
#endif
