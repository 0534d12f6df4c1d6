// Puts the history up to this frame in the place of what composite.comp has made of this frame alone:
// the composite, and the denoiser's input with its variance and number of samples.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/halves.glsl"
#include "shaders/lib/show.glsl"

// The history up to this frame, of the picture (history.comp).
layout(scalar) readonly buffer KeptLights { vec4 kept_lights[]; };
layout(scalar) readonly buffer KeptSquares { vec4 kept_squares[]; };
layout(scalar) readonly buffer KeptUncovered { vec4 kept_uncovered[]; };
layout(scalar) readonly buffer KeptAlbedos { uvec2 kept_albedos[]; };
layout(scalar) readonly buffer Covers { float covers[]; };  // history_cover.comp
// Of the band, as composite.comp makes them.
layout(scalar) buffer Composites { vec4 composites[]; };
layout(scalar) buffer Signals { vec4 signals[]; };
layout(scalar) buffer Variances { vec4 variances[]; };  // w: number of samples
layout(scalar) buffer Surfaces { vec4 surfaces[]; };
layout(scalar) buffer Uncovered { vec4 uncovered[]; };
layout(scalar) buffer Reals { vec4 reals[]; };
layout(scalar) buffer Albedos { uvec2 albedos[]; };

void main() {
  if (gl_GlobalInvocationID.x >= show.count) return;
  const uint in_band = show.in_band + gl_GlobalInvocationID.x;
  const uint index = show.in_picture + in_band;
  const vec4 kept = kept_lights[index];
  const vec4 squares = kept_squares[index];
  const vec4 own = kept_uncovered[index];
  const float mask = squares.w;
  const vec3 albedo_now = unpack_halves(albedos[in_band]);
  // An edge is kept as light. If it has become whole, it is filtered without its albedo again.
  const bool becomes_whole = own.w > 0.0 && (mask <= 0.0 || mask >= 1.0);
  const uvec2 halves = becomes_whole ? albedos[in_band] : kept_albedos[index];
  const vec3 albedo = unpack_halves(halves);
  const vec3 factor = becomes_whole ? 1.0 / albedo : vec3(1.0);
  const vec3 light = factor * kept.rgb;
  const vec3 real = reals[in_band].rgb * albedo_now;

  const Estimate estimate = Estimate(show.white * albedo * light, mask,
                                     show.white * albedo * factor * own.rgb, show.white * real);
  composites[in_band] = vec4(compose(measured_at(in_band), estimate), mask);
  signals[in_band].rgb = light;
  uncovered[in_band] = vec4(factor * own.rgb, 0.0);
  reals[in_band] = vec4(real / albedo, 0.0);
  // Where rays have found how much of an outline is covered, denoise_edges.comp mixes what is on its two
  // sides anew; it finds the share, plus 1, beside the albedo.
  const float cover = covers[index];
  const bool is_mixed_anew = show.is_denoised != 0u && cover != COVER_UNKNOWN;
  albedos[in_band] =
      is_mixed_anew ? uvec2(halves.x, halves.y | packHalf2x16(vec2(0.0, 1.0 + cover))) : halves;
  if (is_mixed_anew) composites[in_band] = vec4(vec3(0.0), cover);
  if (surfaces[in_band].w != DENOISE_HIGHLIGHT) surfaces[in_band].w = mask;
  // The variance of a weighted mean is that of a sample times the sum of the squared weights, which
  // the mean square is short of (Bessel's correction).
  const vec3 spread = max(factor * factor * squares.rgb - light * light, vec3(0.0));
  const vec3 variance = kept.w < 0.999 ? spread * kept.w / (1.0 - kept.w) : vec3(0.0);
  variances[in_band] = vec4(variance, 1.0 / kept.w);
}
