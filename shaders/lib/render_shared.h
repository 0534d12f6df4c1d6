// Structures of the renderer that cross between C++ and the shaders, with their layout (scalar).
// What tracing needs is in shared.h.
#ifndef PREVIZ_RENDER_SHARED_H
#define PREVIZ_RENDER_SHARED_H

#include "shaders/lib/shared.h"

#ifdef __cplusplus
#include <cstddef>
namespace previz::gpu {
#endif

// Set 0, the scene. Texel buffers come first; BINDING_BVH (0) is shared.h's.
//   VERTICES    RGBA32F, 2 texels a vertex: position, u; normal, v (object space)
//   TRIANGLES   RGBA32UI, 1 texel a triangle: three indices into VERTICES
//   TEXELS      RG32UI, all textures one after the other: four halves a texel, linear
//   ENVIRONMENT RGBA32F, (size + 2)^2: the map with a border wrapped by the octahedral rule
//   ALBEDO      R32F, tables of ALBEDO_SIDE^2 (daemon/render/albedo_table.hpp): the reflection's,
//               then for each rough glass one seen from outside and one from inside
//   IMPORTANCE  RGBA32F, quadtree of sampling density: level l has 4^l texels, each the density
//               of its four children; mean density 1 on every level
PREVIZ_CONST uint BINDING_VERTICES = 1u;
PREVIZ_CONST uint BINDING_TRIANGLES = 2u;
PREVIZ_CONST uint BINDING_TEXELS = 3u;
PREVIZ_CONST uint BINDING_ENVIRONMENT = 4u;
PREVIZ_CONST uint BINDING_IMPORTANCE = 5u;
PREVIZ_CONST uint BINDING_RAYS = 6u;        // RG32F, (width + 1)(height + 1): x/z, y/z of pixel corners
PREVIZ_CONST uint BINDING_ALBEDO = 7u;
PREVIZ_CONST uint BINDING_INSTANCES = 8u;   // GpuInstance[]
PREVIZ_CONST uint BINDING_MATERIALS = 9u;  // GpuMaterial[]
PREVIZ_CONST uint BINDING_TEXTURES = 10u;  // GpuTexture[]
PREVIZ_CONST uint BINDING_LIGHTS = 11u;     // GpuLight[]
PREVIZ_CONST uint BINDING_FRAME = 12u;      // GpuFrame
PREVIZ_CONST uint BINDING_BOUNDS = 13u;     // vec4[]: centre and radius of each differing object,
                                            // then of each object that can reflect without blur
PREVIZ_CONST uint SCENE_BINDINGS = 14u;

PREVIZ_CONST uint ALBEDO_SIDE = 32u;
// Glass below this index bends light too little for its roughness to show; it is taken as smooth.
PREVIZ_CONST float LEAST_ROUGH_IOR = 1.001f;

// Set 1, paths in flight and what they bring back. A slot is one sample of one pixel; it has two
// paths, because it can fork once: path 2 slot, and path 2 slot + 1 for the world that parted. With
// FEATURE_CAMERA a path that landed can fork once more: path 2 slots + slot.
PREVIZ_CONST uint BINDING_RAY_ORIGIN = 0u;     // vec4[path]: origin, t_min
PREVIZ_CONST uint BINDING_RAY_DIRECTION = 1u;  // vec4[path]: unit direction, pdf (0: no MIS)
PREVIZ_CONST uint BINDING_THROUGHPUT = 2u;     // vec4[path]: throughput, bits of PATH_*
PREVIZ_CONST uint BINDING_HIT = 3u;            // GpuHit[path]
PREVIZ_CONST uint BINDING_QUEUE = 4u;          // uint[2][paths]: paths to extend, ping-pong
PREVIZ_CONST uint BINDING_SHADOW = 5u;         // GpuShadowRay[paths]
PREVIZ_CONST uint BINDING_SAMPLE_MIXED = 6u;   // vec4[slot]: Lm, M
PREVIZ_CONST uint BINDING_SAMPLE_REAL = 7u;    // vec4[slot]: Lr, one of SAMPLE_*
PREVIZ_CONST uint BINDING_SAMPLE_AOV = 8u;     // vec4[slot]: normal, depth (0: no hit)
PREVIZ_CONST uint BINDING_CONTROL = 9u;        // GpuControl
PREVIZ_CONST uint BINDING_PIXELS = 10u;        // GpuPixel[width * height]
PREVIZ_CONST uint BINDING_LIMITS = 11u;        // uint[]: of each block of the picture, row-major,
                                               // how many samples its pixels get
PREVIZ_CONST uint BINDING_SAMPLE_LANDED = 12u; // vec4[slot]: the real part of PATH_LANDED
PREVIZ_CONST uint PATH_BINDINGS = 13u;

// Set 2, the photons of one pass, in a hash grid of cells twice as wide as the radius. What is
// gathered from comes as texel buffers, faster on lavapipe, which are views of the last two.
//   FOUND_PHOTONS RGBA32F, 4 texels a photon, those of a bucket together: position, Dirac vertices;
//                 direction, gain in the mixed world; normal, gain in the real world; flux
//   FOUND_BUCKETS RG32UI: first photon, number of photons
PREVIZ_CONST uint BINDING_FOUND_PHOTONS = 0u;
PREVIZ_CONST uint BINDING_FOUND_BUCKETS = 1u;
PREVIZ_CONST uint BINDING_PHOTONS = 2u;         // GpuPhoton[2 * photon_count]; two, for a fork
PREVIZ_CONST uint BINDING_PHOTON_ORDER = 3u;    // uint[]: photons, those of a bucket together
PREVIZ_CONST uint BINDING_PHOTON_FILLED = 4u;   // uint[]: of a bucket, while ORDER is made
PREVIZ_CONST uint BINDING_PHOTON_CONTROL = 5u;  // GpuPhotonControl
PREVIZ_CONST uint BINDING_PHOTON_SORTED = 6u;   // vec4[]: FOUND_PHOTONS, to write
PREVIZ_CONST uint BINDING_PHOTON_BUCKETS = 7u;  // GpuPhotonBucket[], a power of two; FOUND_BUCKETS
PREVIZ_CONST uint PHOTON_BINDINGS = 8u;
PREVIZ_CONST uint TEXELS_PER_PHOTON = 4u;

// Set 3, what the camera has measured of the real world: the plate and how far its surfaces are.
//   SEEN_RADIANCE RGBA32F, width * height: radiance, 1 / depth of the surface (0: not to be used).
//                 A view of PLATE, in which the fourth component says before SEEN whether it may be.
PREVIZ_CONST uint BINDING_SEEN_RADIANCE = 0u;
PREVIZ_CONST uint BINDING_PLATE = 1u;  // vec4[], to write
PREVIZ_CONST uint BINDING_SEEN = 2u;   // GpuSeen[]
PREVIZ_CONST uint CAMERA_BINDINGS = 3u;

// Set 0 of the passes that take noise out of a picture (daemon/render/denoiser.hpp); texel buffers
// RGBA32F, width * height, and those to write, which the next pass reads.
//   DENOISE_SIGNAL    signal over the sensor's white (ratio, hybrid: over the camera's picture where
//                     nothing covers it), 1 / depth (0: none)
//   DENOISE_VARIANCE  the signal's, to be multiplied by the fourth component
//   DENOISE_SURFACE   normal, mean(M)
PREVIZ_CONST uint BINDING_DENOISE_SIGNAL = 0u;
PREVIZ_CONST uint BINDING_DENOISE_VARIANCE = 1u;
PREVIZ_CONST uint BINDING_DENOISE_SURFACE = 2u;
PREVIZ_CONST uint BINDING_DENOISED_SIGNAL = 3u;    // vec4[]
PREVIZ_CONST uint BINDING_DENOISED_VARIANCE = 4u;  // vec4[]
PREVIZ_CONST uint DENOISE_BINDINGS = 5u;

// Pixels from which the variance of a single sample is taken, to each side.
PREVIZ_CONST uint DENOISE_VARIANCE_REACH = 3u;
// A channel that comes out at this share of the sensor's white is white: a step of 8 bits below it.
PREVIZ_CONST float NEARLY_WHITE = 0.99f;

// Set 0 of the passes that make the picture that is shown (daemon/render/presenter.hpp), a band of
// rows at a time.
PREVIZ_CONST uint BINDING_SHOW_PIXELS = 0u;      // GpuPixel[], a tile's
PREVIZ_CONST uint BINDING_SHOW_PLATE = 1u;       // uint[], the band's: samples, interleaved RGB, two
                                                 // in each
PREVIZ_CONST uint BINDING_SHOW_SIGNAL_OF = 2u;   // float[]: the linear signal of each code
PREVIZ_CONST uint BINDING_SHOW_LEAST_OF = 3u;    // float[]: the least signal that becomes the code
PREVIZ_CONST uint BINDING_SHOW_COMPOSITE = 4u;   // vec4[], the band's: composite, mean(M)
PREVIZ_CONST uint BINDING_SHOW_SIGNAL = 5u;      // vec4[]: DENOISE_SIGNAL, to write
PREVIZ_CONST uint BINDING_SHOW_VARIANCE = 6u;    // vec4[]: DENOISE_VARIANCE, to write
PREVIZ_CONST uint BINDING_SHOW_SURFACE = 7u;     // vec4[]: DENOISE_SURFACE, to write
PREVIZ_CONST uint BINDING_SHOW_DENOISED = 8u;    // vec4[]: SIGNAL to read, denoised or as it was
PREVIZ_CONST uint BINDING_SHOW_PICTURE = 9u;     // uint[], to write: as PLATE, of what is shown
PREVIZ_CONST uint SHOW_BINDINGS = 10u;

// How the difference is put onto the camera's picture: set::Composite.
PREVIZ_CONST uint COMPOSITE_ADDITIVE = 0u;
PREVIZ_CONST uint COMPOSITE_RATIO = 1u;
PREVIZ_CONST uint COMPOSITE_HYBRID = 2u;

// What a slot holds, in the fourth component of its SAMPLE_REAL.
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
  uint first;  // in ORDER
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
  uint queue_side;        // which half of QUEUE is active
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
  uint first_triangle;  // in TRIANGLES
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
  uint albedo_table;  // rough glass: of ALBEDO, seen from outside; the next one is from inside
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
  uint environment_levels;    // of IMPORTANCE
  float environment_selection;  // probability that a light sample picks the environment
  uint light_count;
  uint visible_light_count;   // the first lights, those with an extent that are not triangles
  uint bound_count;
  float bound_share;          // of a shared path's directions, at most, towards those BOUNDS
  float environment_spread;   // solid angle over 2 pi that light samples find its light in
  float lamp_spread;          // the same of the lights
  float lamp_part;            // of all light, that of the lights
  float difference_roulette;  // survival of a path of the difference over the bounds' solid angle
  uint specular_bound_count;  // the BOUNDS after them
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
