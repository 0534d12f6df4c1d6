// The denoiser's passes share these buffers, which each pass reads from one side and writes to
// the other, and a distance that says how far two pixels show the same surface (shaders/README.md,
// "Denoising").
#ifndef PREVIZ_DENOISE_GLSL
#define PREVIZ_DENOISE_GLSL

#include "shaders/lib/fetch.glsl"
#include "shaders/lib/render_shared.h"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform Denoise { GpuDenoise denoise; };
// width * height: the signal (the change of the composite) over the sensor's white and over
// the surface's albedo, 1 / depth (0: none).
PREVIZ_FETCHED(vec4, signals)
PREVIZ_FETCHED(vec4, variances)  // of the signal, to be multiplied by the fourth component
PREVIZ_FETCHED(vec4, surfaces)   // normal, mean(M) or DENOISE_HIGHLIGHT

// A neighbour's weight has fallen to 1 / e at a squared chord between the normals of NORMAL_SCALE,
// or where the inverse depth is off what the surface's
// slope predicts by a share of DEPTH_SCALE.
const float NORMAL_SCALE = 0.1;
const float DEPTH_SCALE = 0.03;

struct Pixel {
  vec3 signal;
  float inverse_depth;  // 0 where the ray met nothing
  vec3 variance;        // as if neighbours were independent
  float overlap;        // true variance over `variance`: blended neighbours share pixels
  vec3 normal;
  float cover;          // mean(M)
};

int pixel_index(ivec2 at) { return at.y * int(denoise.width) + at.x; }

bool is_inside(ivec2 at) {
  return all(greaterThanEqual(at, ivec2(0))) &&
         all(lessThan(at, ivec2(denoise.width, denoise.height)));
}

Pixel load_pixel(ivec2 at) {
  const int index = pixel_index(at);
  const vec4 signal = fetch(signals, index);
  const vec4 surface = fetch(surfaces, index);
  const vec4 variance = fetch(variances, index);
  return Pixel(signal.rgb, signal.w, variance.rgb, variance.w, surface.xyz, surface.w);
}

// Returns whether a virtual object covers the pixel in part.
bool is_edge(Pixel pixel) { return pixel.cover > 0.0 && pixel.cover < 1.0; }

// Returns whether two pixels `off` apart may be blended. The difference Lm - Lr never is with a
// virtual object that covers it, nor a hit with a miss, nor anything with a highlight. An edge,
// which has some of both, is left to denoise_edges.comp.
bool are_alike(Pixel a, Pixel b, ivec2 off) {
  if (off == ivec2(0)) return true;
  return a.cover == b.cover && !is_edge(a) &&
         (a.inverse_depth > 0.0) == (b.inverse_depth > 0.0);
}

// Returns the change of the inverse depth from pixel to pixel, which is constant over a plane. It
// is the mean of the slopes on both sides, or the flatter one where the two differ, since an edge
// is between them. The slopes are taken over two pixels, because with few samples the depth of a
// pixel is that of some point in it.
float inverse_depth_slope(ivec2 at, ivec2 off, float here) {
  const int reach = 2;
  const ivec2 before = at - reach * off;
  const ivec2 behind = at + reach * off;
  float falling = 3.4e38;
  float rising = 3.4e38;
  if (is_inside(before)) falling = (here - fetch(signals, pixel_index(before)).w) / float(reach);
  if (is_inside(behind)) rising = (fetch(signals, pixel_index(behind)).w - here) / float(reach);
  const bool is_one_surface = max(rising, falling) < 3.4e38 &&
                              abs(rising - falling) <= 0.5 * max(abs(rising), abs(falling));
  if (is_one_surface) return 0.5 * (rising + falling);
  return abs(rising) < abs(falling) ? rising : falling;
}

// Returns the change of the inverse depth to the right and downwards.
vec2 inverse_depth_slopes(ivec2 at, float here) {
  return vec2(inverse_depth_slope(at, ivec2(1, 0), here),
              inverse_depth_slope(at, ivec2(0, 1), here));
}

// Returns the squared distance of two pixels as parts of one surface, in units of the scales above.
// `foretold` is the inverse depth of b by the slope at a.
float surface_distance(Pixel a, Pixel b, float foretold) {
  const vec3 chord = a.normal - b.normal;
  const float depth = a.inverse_depth > 0.0
                          ? (b.inverse_depth - foretold) / (DEPTH_SCALE * a.inverse_depth)
                          : 0.0;
  return dot(chord, chord) / NORMAL_SCALE + depth * depth;
}

#endif
