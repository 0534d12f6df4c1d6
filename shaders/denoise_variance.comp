// Prepares the variance for the denoiser. A few samples give a poor estimate of their variance, so
// it is raised to the mean over the pixel's neighbours. A single sample gives none, so it is
// estimated from how the neighbours' signals scatter. With history every pixel has a number of
// samples of its own.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/denoise.glsl"

PREVIZ_FETCHED_HALVES(albedos)  // w: 0, or 1 and more at an outline that is mixed anew
// The levels of the transform read these.
layout(scalar) writeonly buffer DenoisedSignals { vec4 denoised_signals[]; };
layout(scalar) writeonly buffer DenoisedVariances { vec4 denoised_variances[]; };

vec3 mean_variance(ivec2 at, Pixel here) {
  vec3 sum = vec3(0.0);
  float count = 0.0;
  for (int y = -1; y <= 1; ++y)
    for (int x = -1; x <= 1; ++x) {
      if (!is_inside(at + ivec2(x, y))) continue;
      const Pixel there = load_pixel(at + ivec2(x, y));
      if (!are_alike(here, there, ivec2(x, y))) continue;
      sum += there.variance;
      count += 1.0;
    }
  return sum / count;
}

vec3 variance_of_neighbours(ivec2 at, Pixel here) {
  const int reach = int(DENOISE_VARIANCE_REACH);
  vec3 sum = vec3(0.0);
  vec3 square = vec3(0.0);
  float count = 0.0;
  for (int y = -reach; y <= reach; ++y)
    for (int x = -reach; x <= reach; ++x) {
      if (!is_inside(at + ivec2(x, y))) continue;
      const Pixel there = load_pixel(at + ivec2(x, y));
      if (!are_alike(here, there, ivec2(x, y))) continue;
      const vec3 off = there.signal - here.signal;
      sum += off;
      square += off * off;
      count += 1.0;
    }
  return max(square / count - (sum / count) * (sum / count), vec3(0.0));
}

// A history of fewer samples does not know its variance.
const float LEAST_KNOWING = 4.0;
// The samples of a history follow one another in sequences that fill pixel and paths evenly, so that their
// mean is nearer to the truth than that of independent ones. From 2 * LEAST_KNOWING on, this share of the
// variance of what changes on real surfaces is left. On virtual objects, whose light is seen by itself,
// what remains of the noise would be seen as stains (tests/truth/RESULTS.md, "Live").
const float LEFT_BY_EVENNESS = 0.5;
// Beside an outline it is less, because a contact shadow is as narrow as a pixel.
const float LEFT_AT_OUTLINES = 0.04;

// Returns the variance of a pixel with history. history_show.comp leaves the number of its samples in
// the place of the overlap. The neighbours of a young history may be older and scatter less, for
// which their mean number of samples over the pixel's own makes up.
vec3 variance_with_history(ivec2 at, Pixel here) {
  // An edge is like no neighbour, so a young one knows of no scatter at all. It is taken to be as
  // noisy as a pixel can be.
  if (is_edge(here) && here.overlap < LEAST_KNOWING)
    return vec3(DENOISE_MOST_WHITES * DENOISE_MOST_WHITES);
  if (here.overlap >= LEAST_KNOWING) {
    const float evenness = min(here.overlap / LEAST_KNOWING - 1.0, 1.0);
    const bool is_outline = fetch(albedos, pixel_index(at)).w > 0.0;
    const float least = is_outline ? LEFT_AT_OUTLINES : LEFT_BY_EVENNESS;
    const float left = here.cover > 0.0 ? 1.0 : mix(1.0, least, evenness);
    return left * max(here.variance, mean_variance(at, here));
  }
  const int reach = int(DENOISE_VARIANCE_REACH);
  float samples = 0.0;
  float count = 0.0;
  for (int y = -reach; y <= reach; ++y)
    for (int x = -reach; x <= reach; ++x) {
      if (!is_inside(at + ivec2(x, y))) continue;
      const Pixel there = load_pixel(at + ivec2(x, y));
      if (!are_alike(here, there, ivec2(x, y))) continue;
      samples += there.overlap;
      count += 1.0;
    }
  return variance_of_neighbours(at, here) * samples / (count * max(here.overlap, 1.0));
}

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= denoise.width * denoise.height) return;
  const ivec2 at = ivec2(index % denoise.width, index / denoise.width);
  const Pixel here = load_pixel(at);
  const vec3 variance = denoise.has_history != 0u ? variance_with_history(at, here)
                        : denoise.single_sample != 0u
                            ? variance_of_neighbours(at, here)
                            : max(here.variance, mean_variance(at, here));
  denoised_signals[index] = vec4(here.signal, here.inverse_depth);
  denoised_variances[index] = vec4(variance, 1.0);
}
