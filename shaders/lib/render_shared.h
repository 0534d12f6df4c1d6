// Structures and constants of the renderer that cross between C++ and the shaders, in scalar
// layout. Those that tracing needs are in shared.h, features and materials in material_shared.h.
#ifndef PREVIZ_RENDER_SHARED_H
#define PREVIZ_RENDER_SHARED_H

#include "shaders/lib/material_shared.h"
#include "shaders/lib/shared.h"

#ifdef __cplusplus
#include <cstddef>
namespace previz::gpu {
#endif

// A table of daemon/core/render/world/albedo_table.hpp has this many texels on each side.
PREVIZ_CONST uint ALBEDO_SIDE = 32u;
// The place of sheen's table among them, where any surface has sheen.
PREVIZ_CONST uint ALBEDO_SHEEN = 1u;
// An anisotropic reflection has so many tables, each for another azimuth of the viewer.
PREVIZ_CONST uint ANISOTROPIC_TABLES = 9u;
// Where a texture changes its strength it has them for so many equal steps of the strength, from the
// first step to the whole.
PREVIZ_CONST uint ANISOTROPIC_STEPS = 8u;
// The GGX alpha of an anisotropic reflection is at least this in any direction.
PREVIZ_CONST float LEAST_ANISOTROPIC_ALPHA = 1e-3f;
// Glass below this index of refraction is treated as smooth, since it bends light too little for
// its roughness to show.
PREVIZ_CONST float LEAST_ROUGH_IOR = 1.001f;

PREVIZ_CONST uint TEXELS_PER_PHOTON = 4u;

// Pixels from which the variance of a single sample is taken, to each side.
PREVIZ_CONST uint DENOISE_VARIANCE_REACH = 3u;
// What a pixel changes is filtered up to this many times the sensor's white. Brighter light, such as
// a mirrored lamp that few samples meet, would spread over all its neighbours.
PREVIZ_CONST float DENOISE_MOST_WHITES = 4.0f;
// Stands for the mask of a pixel that the denoiser leaves as it is.
PREVIZ_CONST float DENOISE_HIGHLIGHT = 2.0f;
// An edge's pixels are compared with those this far around them.
PREVIZ_CONST uint DENOISE_EDGE_REACH = 2u;
// A channel counts as white from this share of the sensor's white on, a step of 8 bits below it.
PREVIZ_CONST float NEARLY_WHITE = 0.99f;

// Codes are looked for from so many places of the response on (lib/response.glsl).
PREVIZ_CONST uint CODE_BINS = 1024u;

// How the difference is put onto the camera's picture: set::Composite.
PREVIZ_CONST uint COMPOSITE_ADDITIVE = 0u;
PREVIZ_CONST uint COMPOSITE_RATIO = 1u;
PREVIZ_CONST uint COMPOSITE_HYBRID = 2u;

// Bits of specialisation constant 2 of shade.comp: what it does at the ends of the paths. A pass that
// does not scatter leaves the paths as they are.
PREVIZ_CONST uint SHADE_RECEIVE = 1u;  // adds the light that arrives, and what is seen
PREVIZ_CONST uint SHADE_LIGHT = 2u;    // samples a light
PREVIZ_CONST uint SHADE_SCATTER = 4u;  // forks, and samples the next direction
PREVIZ_CONST uint SHADE_ALL = 7u;

// The fourth component of SAMPLE_REAL says what was traced for the slot.
PREVIZ_CONST float SAMPLE_FULL = 0.0f;        // both radiances
PREVIZ_CONST float SAMPLE_DIFFERENCE = 1.0f;  // only the difference of the two

// The pixels of a block, of so many a side, fall into parts by their place in squares of 2x2; those of
// one part get the same number of samples.
PREVIZ_CONST uint SAMPLED_BLOCK = 8u;
PREVIZ_CONST uint SAMPLED_PARTS = 4u;
PREVIZ_CONST uint UNLIMITED = 0xffffffffu;

PREVIZ_CONST uint NO_INDEX = 0xffffffffu;

// These bits are a path's state.
PREVIZ_CONST uint PATH_WORLDS_MASK = 3u;      // WORLD_*
PREVIZ_CONST uint PATH_DEPTH_SHIFT = 8u;      // number of surface vertices so far
PREVIZ_CONST uint PATH_ROUGH = 4u;            // some lobe so far was not Dirac
PREVIZ_CONST uint PATH_DIFFERENCE = 8u;       // while in both worlds, only the difference is traced
PREVIZ_CONST uint PATH_LANDED = 16u;          // took the plate's radiance at a vertex and
                                              // continues for Lm - Lr of that vertex
PREVIZ_CONST uint PATH_BEHIND = 32u;          // goes on behind the pane at its origin + t_min
PREVIZ_CONST uint PATH_PASSES_SHIFT = 16u;    // number of panes so far that it met and passed
PREVIZ_CONST uint PATH_MEDIUM_SHIFT = 20u;    // medium that the path is in (lib/medium.glsl)
PREVIZ_CONST uint MAX_MEDIUM = 0xfffu;

// A path meets and passes no more sides of coloured panes than these.
PREVIZ_CONST uint MOST_PASSES = 8u;

// What a path carries. The state is a word: read as a float it would be denormal, which a device may
// take for zero.
struct GpuThroughput {
  vec3 factor;
  uint state;  // bits of PATH_*
};

struct GpuHit {
  float t;  // below 0: nothing was hit
  vec2 barycentrics;
  uint instance;
  uint primitive;
};

struct GpuShadowRay {
  vec3 origin;
  float t_max;
  vec3 direction;
  uint path_and_worlds;  // path << 3 | landed << 2 | WORLD_*
  // What arrives in each world if nothing blocks it: throughput * f * cos * Le / pdf * MIS weight,
  // times the lamp's gain there.
  vec3 mixed;
  vec3 real;
};

// A hit and a shadow ray lie in memory as so many pairs of words (lib/path.glsl).
PREVIZ_CONST uint HIT_TEXELS = 3u;
PREVIZ_CONST uint SHADOW_RAY_TEXELS = 7u;

// A photon that arrived, by way of Dirac lobes only, at a surface with a lobe that is not Dirac.
struct GpuPhoton {
  vec3 position;
  uint vertices;   // Dirac vertices on its way
  vec3 direction;  // unit, in which it travelled
  vec3 normal;     // geometric, on the side from which it arrived
  // Its flux in each world: watts, not yet divided by the number of photons of the pass. Until the
  // photon is stored these are the gains of its lamp.
  vec3 mixed;
  vec3 real;
};

struct GpuPhotonBucket {
  uint first;  // of sorted_photons
  uint count;
};

// Photons are sorted by so many bits of their bucket's number at a time (lib/photon_sort.glsl). A work
// group has the counts of each digit for each of its invocations, which takes 16 KiB of its memory:
// there are as many invocations as pairs of digits.
PREVIZ_CONST uint PHOTON_DIGIT_BITS = 7u;
PREVIZ_CONST uint PHOTON_DIGITS = 1u << PHOTON_DIGIT_BITS;
PREVIZ_CONST uint PHOTON_RUN = 32u;  // keys that an invocation moves
PREVIZ_CONST uint MOST_PHOTON_PASSES = 5u;  // for the 32 bits of any bucket's number

struct GpuPhotonControl {
  uint stored;
  uint totals[MOST_PHOTON_PASSES * PHOTON_DIGITS];  // of each digit, pass by pass of the sort
};

// The sums of a pixel's samples. They are two-float sums (value = high + low), so that 1e7 samples
// lose nothing (shaders/README.md, "Accumulation").
struct GpuPixel {
  vec4 mixed_high;  // Lm, M
  vec4 mixed_low;
  vec4 diff_high;   // Lm - Lr, depth
  vec4 diff_low;
  vec4 uncovered_high;  // (1 - M)(Lm - Lr); w: number of SAMPLE_DIFFERENCE
  vec4 uncovered_low;
  vec4 square_high;  // squares, for the variance: of Lm where M = 1, of Lm - Lr where M = 0;
  vec4 square_low;   // w: number of samples
  vec4 normal;      // sum of normals; w: number of samples that hit a surface
  vec4 albedo;      // sum of albedos (lib/path.glsl); 0 where only materials have colours
};

// The first surface of the real world at the middle of a pixel.
struct GpuSeen {
  float inverse_depth;  // 1/m, along the optical axis; 0: none, or it may be transparent
  uint instance;
};

struct GpuControl {
  uint extend_groups[4];  // indirect dispatch arguments (x, y, z), padding
  uint shadow_groups[4];
  uint active_count;      // paths in the queue being worked on
  uint next_count;        // paths appended to the next queue
  uint shadow_count;
  uint queue_side;        // which half of the queue is active
  uint rays_low, rays_high;
  uint shadow_rays_low, shadow_rays_high;
  uint dropped_not_finite;
  uint dropped_negative;
  uint stopped_in_layers;
  uint unfinished;  // paths that a batch left in the queue
  uint measured_low, measured_high;      // vertices whose radiance the plate gave
  uint unmeasured_low, unmeasured_high;  // real vertices for which it could not
  uint below_zero;  // pixels of shown pictures in which the composite's rule gave less than no light
};

struct GpuInstance {
  vec4 world_from_object[3];  // rows; camera-relative world
  vec4 object_from_world[3];
  uint material;
  uint first_triangle;  // in TRIANGLES
  uint first_light;     // of its emissive triangles; NO_INDEX if it emits nothing
  uint presence;
  // What else its vertices have: extras_per_vertex values from first_extra + v * extras_per_vertex
  // on in EXTRAS, for the vertex v (modulo 2^32). The first is the colour, the others are texture
  // coordinates. 0: nothing.
  uint first_extra;
  uint extras_per_vertex;
  uint tangent_extra;  // which of them is the tangent, four fractions from -1 to 1; 0: none
  uint padding;
};

PREVIZ_CONST uint TEXTURE_REPEAT = 0u;
PREVIZ_CONST uint TEXTURE_CLAMP = 1u;
PREVIZ_CONST uint TEXTURE_MIRROR = 2u;

struct GpuTexture {
  uint first_texel;
  uint width, height;
  uint wrap_u, wrap_v;
  uint nearest;
  uint levels;        // beyond this one: means over ever larger areas, textures of their own
  uint first_level;   // the first of them, in TEXTURES
};

PREVIZ_CONST uint LIGHT_POINT = 0u;
PREVIZ_CONST uint LIGHT_SPOT = 1u;
PREVIZ_CONST uint LIGHT_DIRECTIONAL = 2u;
PREVIZ_CONST uint LIGHT_RECTANGLE = 3u;
PREVIZ_CONST uint LIGHT_SPHERE = 4u;
PREVIZ_CONST uint LIGHT_TRIANGLE = 5u;

// A light in camera-relative world space. Its position is in a buffer of its own, because it changes
// with the camera, and is put here by light_at().
struct GpuLight {
  vec3 position;   // point, spot, sphere centre, rectangle centre, triangle's first vertex
  uint type;
  vec3 direction;  // in which light travels; triangle: unit normal
  float radius;    // sphere
  vec3 edge_u;     // rectangle: whole width; triangle: v1 - v0
  float cos_inner; // spot
  vec3 edge_v;     // rectangle: whole height; triangle: v2 - v0
  float cos_outer; // spot
  vec3 emission;   // intensity, irradiance (directional delta) or radiance
  float cone_sr;   // directional: solid angle of its disc, 0 for a delta light
  vec3 gain_mixed; // factors of the emission in each world
  float selection; // probability that a light sample picks this light
  vec3 gain_real;
  float cdf;       // sum of selection up to and including this light
  vec2 uv0, uv1, uv2;  // triangle: where its corners are in the emission's texture
  uint emission_texture;
  uint alpha_instance;   // triangle whose alpha weakens the light: its instance; NO_INDEX if opaque
  uint alpha_primitive;  // and its place in the mesh
  uint leaf;              // of LIGHT_TREE; NO_INDEX: the light is not in the tree
  float rest_selection;   // probability that a light sample picks this light without the tree
  float rest_cdf;         // the share of these up to and including this light
};

// A node of the tree of lamps (daemon/core/render/world/light_tree.hpp). The root is the first; the children of
// a node are neighbours, the first at an even index.
struct GpuLightNode {
  vec3 center;           // of a sphere around the lamps, from the tree's origin
  float radius_squared;
  vec3 axis;             // of the directions in which they shine
  float intensity;       // sum of their largest ones
  float cos_spread;      // of the cone of their axes,
  float least_cosine;    // and of the angle around these beyond which they do not shine
  uint first;            // its first child; of a leaf: its light
  uint links;            // LIGHT_NODE_*, and the node behind all below this one; 0: there is none
};
PREVIZ_CONST uint LIGHT_NODE_LEAF = 1u;
PREVIZ_CONST uint LIGHT_NODE_TWO_SIDED = 2u;
PREVIZ_CONST uint LIGHT_NODE_VISIBLE = 4u;  // some lamp has an extent and no mesh
PREVIZ_CONST uint LIGHT_NODE_DIFFERS = 8u;  // and does not shine alike in both worlds
PREVIZ_CONST uint LIGHT_NODE_NEXT_SHIFT = 4u;
// So few lights are chosen by power alone, and a ray tries all that it could see; a tree pays for more.
PREVIZ_CONST uint FEW_LIGHTS = 4u;

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
  uint environment_levels;    // levels of IMPORTANCE
  float environment_selection;  // probability that a light sample picks the environment
  uint light_count;
  uint visible_light_count;   // the first lights: those with an extent, without triangles
  uint bound_count;           // BOUNDS of objects that are in one world only
  float bound_share;          // largest share of a shared path's directions towards those BOUNDS
  float environment_spread;   // solid angle over 2 pi from which the environment's light comes
  float lamp_spread;          // the same for the lights
  float lamp_part;            // share of the lights in all power
  uint specular_bound_count;  // BOUNDS that follow, at which photons are aimed
  uint photon_count;          // emitted per pass
  float photon_environment;   // probability that a photon starts from the environment
  vec3 scene_center;
  float scene_radius;         // of a sphere that contains everything
  uint clip_from;             // code of the plate from which a channel may be clipped; NO_INDEX: none
  vec2 focal_px, principal_px;  // of the observer's lens, OpenCV's convention
  vec3 radial;                  // k1, k2, k3
  vec3 radial_divisor;          // k4, k5, k6
  vec2 tangential;              // p1, p2
  float exposure;               // signal over radiance
  uint keeps_albedo;            // 1: the scene has textures, which the denoiser divides by
  float tree_share;             // probability that a light sample of a light takes the tree; 0: none
  vec3 tree_offset;             // of the camera from the tree's origin
  uint distant_light_count;     // the first of the visible lights: discs at infinity
  uint past_samples;            // of earlier frames, after which the random numbers go on
  uint has_separate_parts;      // 1: the SAMPLED_PARTS of a block have independent random numbers
};

// Push constants of a batch: a part of the picture and a range of samples.
struct GpuBatch {
  uint x, y, width, height;   // tile
  uint first_sample, samples;
  float photon_radius;        // over the distance from the camera; the photons of a pass serve the
                              // sample of the same index
  uint photon_digit;          // of the buckets' numbers, by which photons are sorted; 0: the lowest
};

// Push constants of the denoiser's passes.
struct GpuDenoise {
  uint width, height;
  uint step;            // pixels between neighbours
  uint single_sample;   // 1: pixels have one sample, and so no variance of their own
  uint has_companions;  // 1: `uncovered` and `reals` are filtered as well, with the same weights
  uint has_history;     // 1: pixels have samples of earlier frames, as many as the history says
  uint has_caustics;    // 1: what photons bring is added after the filter
};

// Where an instance was in the frame before (daemon/core/render/passes/history.hpp).
struct GpuMotion {
  vec4 before_from_now[3];  // rows; from the camera-relative world of this frame to that one's
  uint is_known;            // 0: the instance has no history
  // What is added, modulo 2^32, to the number of a vertex for its place among the points that deform in
  // the frame before (lib/deformed.glsl). NO_INDEX: points move as the instance does.
  uint points;
};

// An instance that has moved since the frame before, or has changed otherwise, and the spheres
// around it then and now, relative to this frame's camera.
struct GpuMoved {
  vec4 before, now;  // centre, radius
  float share;       // of itself that it has moved by; 1: it is nowhere near where it was
  float turn;        // radians
  uint instance;
};

// Light that comes from infinity: a directional lamp, or a part of the environment.
struct GpuArrival {
  vec3 direction;  // towards it
  float share;     // of all light
  float width;     // half the angle that it comes from, radians, at most pi / 2
  float cos_width, sin_width;
};

// What the history's passes need beside the picture (shaders/README.md, "Accumulation over time").
struct GpuHistory {
  uint width, height;                // of this frame
  uint width_before, height_before;
  vec4 camera_from_world[3];         // rows of the rotation in the frame before
  vec3 forward;                      // this frame's camera looks there
  vec2 focal_px, principal_px;       // of the lens in the frame before, OpenCV's convention
  vec3 radial;                       // k1, k2, k3
  vec3 radial_divisor;               // k4, k5, k6
  vec2 tangential;                   // p1, p2
  float white_ratio;                 // the sensor's white in the frame before over this frame's
  float samples;                     // that a pixel of this frame has
  float most_samples;                // as which the history of any pixel counts; 0: there is none
  float most_caustic_samples;        // likewise, of the light of photons
  float most_drift;                  // by which light may change over the frames that are averaged
  uint moved_count, arrival_count;
};

// Up to four joints that a vertex follows: scene::Influence.
struct GpuInfluence {
  uint joints_low, joints_high;  // two of 16 bits each, the first in the low half
  vec4 weights;
};

// An offset of a morph target, of one vertex.
struct GpuMorphOffset {
  vec3 position, normal;
};

// A morph target that takes part in a shape.
struct GpuMorphWeight {
  uint target;
  float weight;
};

// Push constants of the pass that deforms a mesh (daemon/core/render/world/deformer.hpp). All firsts count
// elements of the buffers that hold those of all meshes.
struct GpuDeform {
  uint vertices;
  uint first_vertex;
  uint first_undeformed;
  uint influences_per_vertex;  // 0: there is no skin
  uint first_influence;
  uint first_joint;
  uint first_offset;  // of the first target and vertex; a target's offsets are together
  uint first_weight;
  uint weights;
  uint flat_normals;  // 1: vertices 3 i to 3 i + 2 take the normal of their triangle
};

// A leaf of a deforming mesh's tree: its record, counted from the start of the tree, and its four
// vertices, counted from the mesh's first.
struct GpuRefitLeaf {
  uint record;
  uvec4 vertices;
};

// Push constants of the passes that refit a tree.
struct GpuRefit {
  uint count;         // leaves or nodes to work on
  uint first;         // in refit_leaves or refit_nodes
  uint first_record;  // of the tree, in BVH
  uint first_box;     // of the tree, in refit_boxes
  uint first_vertex;  // of the mesh
  float scale;        // grid space over object space
};

// The box of a record in grid space, and the expected visits below and including it, times half the
// tree's surface area.
struct GpuRefitBox {
  vec3 low;
  float cost;
  vec3 high;
};

// How the camera's samples lie in its bytes (drivers/frame.hpp), row by row.
PREVIZ_CONST uint CAMERA_RGB = 0u;     // three 8-bit samples a pixel
PREVIZ_CONST uint CAMERA_GRAY = 1u;    // one sample a pixel
PREVIZ_CONST uint CAMERA_BAYER = 2u;   // one sample a pixel, behind colour filters
PREVIZ_CONST uint CAMERA_YUV422 = 3u;  // planes of 8-bit Y, Cb and Cr, the last two half as wide

// Push constants of the pass that makes the plate's codes of the camera's bytes.
struct GpuCameraFrame {
  uint width, height;  // pixels
  uint first;          // pair of pixels to begin with
  uint arrangement;    // CAMERA_*
  uint is_deep;        // 1: gray and Bayer samples have 16 bits
  uint red_x, red_y;   // column and row, modulo 2, of the red filters
};

// Push constants of the pass that makes a smaller plate of a plate.
struct GpuPlateScale {
  uint from_width, from_height, width, height;  // pixels, the second pair no more than the first
  uint first;                                   // pair of pixels to begin with
  uint most;                                    // the largest code
};

// Push constants of the pass that makes a picture for the screen.
struct GpuScanOut {
  uint count;    // pixels
  uint is_deep;  // 1: codes have 16 bits
};

// Push constants of the passes that make the shown picture.
struct GpuShow {
  uint count;          // pixels to work on
  uint in_tile;        // index of the first one in the tile
  uint in_band;        // and in the band
  uint in_picture;     // index of the band's first pixel in the picture
  uint has_plate;      // 0: the composite is over black
  uint most;           // the largest code
  uint clip_from;      // a channel counts as clipped not at all below this code,
  uint clip_at;        // and wholly from this one on
  uint composite;      // COMPOSITE_*
  float floor;         // radiance, of COMPOSITE_HYBRID
  float exposure;      // signal over radiance
  float white;         // radiance at which the sensor clips, 1 / exposure
  float most_variance; // radiance squared
  uint is_single;      // 1: pixels have one sample, and so no variance of their own
  uint is_denoised;    // 1: the denoised change replaces that of the samples
  uint is_dithered;    // 1: codes are dithered where the worlds differ
  uint width;          // of the picture
  uint has_caustics;   // 1: what photons bring to the change is kept apart
  uint is_enlarged;    // 1: what is added is written in place of the picture, for GpuEnlarge
};

// Push constants of the pass that puts a small rendering onto the camera's whole picture.
struct GpuEnlarge {
  uint count;                    // pixels to work on, of the whole picture
  uint first;                    // the first of them
  uint width;                    // of the whole picture
  uint from_width, from_height;  // of the rendering
  uint most;                     // the largest code
  uint is_dithered;              // as in GpuShow
  float sharpness;               // how many whole pixels are as wide as one of the rendering
  vec2 step;                     // pixels of the rendering over those of the whole picture
};
// Small pixels whose plate is so much brighter or darker than a whole one, as a share of the largest
// code, count half.
PREVIZ_CONST float ENLARGE_BRIGHTNESS = 0.05f;
// Those that are not at all like it count so much, for where there are no others.
PREVIZ_CONST float ENLARGE_LEAST = 1e-4f;
// The class of what is at the middle of a pixel is 0 for a real surface or nothing, 1 for a virtual
// object, and otherwise one of these.
PREVIZ_CONST float COVER_UNKNOWN = -1.0f;
PREVIZ_CONST float COVER_SEE_THROUGH = -2.0f;
// So many rays find which share of an outline is covered.
PREVIZ_CONST float COVER_RAYS = 16.0f;
// So far a pixel looks for the other side of an outline.
PREVIZ_CONST uint HISTORY_REACH = 2u;
// Dithering repeats after so many pixels in both directions.
PREVIZ_CONST uint DITHER_SIDE = 64u;

#ifdef __cplusplus
static_assert(sizeof(GpuDenoise) == 28);
static_assert(sizeof(GpuMotion) == 56);
static_assert(sizeof(GpuMoved) == 44);
static_assert(sizeof(GpuArrival) == 28);
static_assert(sizeof(GpuHistory) == 152);
static_assert(sizeof(GpuShow) == 76);
static_assert(sizeof(GpuEnlarge) == 40);
static_assert(sizeof(GpuHit) == 20);
static_assert(sizeof(GpuShadowRay) == 56);
static_assert(sizeof(GpuPixel) == 160);
static_assert(sizeof(GpuControl) == 100);
static_assert(sizeof(GpuInstance) == 128);  // of INSTANCE_TEXELS
static_assert(sizeof(GpuTexture) == 32);
static_assert(sizeof(GpuLight) == 160);
static_assert(offsetof(GpuLight, uv0) == 112);
static_assert(sizeof(GpuFrame) == 236);
static_assert(sizeof(GpuLightNode) == 48);
static_assert(sizeof(GpuBatch) == 32);
static_assert(sizeof(GpuThroughput) == 16);
static_assert(sizeof(GpuPhoton) == 64);
static_assert(sizeof(GpuPhotonBucket) == 8);
static_assert(sizeof(GpuPhotonControl) == 4 + 4 * MOST_PHOTON_PASSES * PHOTON_DIGITS);
static_assert(sizeof(GpuInfluence) == 24);
static_assert(sizeof(GpuMorphOffset) == 24);
static_assert(sizeof(GpuDeform) == 40);
static_assert(sizeof(GpuRefitLeaf) == 20);
static_assert(sizeof(GpuRefit) == 24);
static_assert(sizeof(GpuRefitBox) == 28);
}  // namespace previz::gpu
#endif
#endif
