// Puts the albedo of surfaces back, which was divided out before the levels of the transform, and
// takes noise out of pixels that a virtual object covers in part, which the levels blend with
// nothing. Such a pixel is mean(M) of the object's light and the rest of the change
// behind it; both are taken from the pixels around it, and the share stays the pixel's own, so that
// edges stay as sharp as they are. The surroundings count as far as noise explains what the pixels
// of the edge are off them (shaders/README.md, "Denoising").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/denoise.glsl"

uniform textureBuffer uncovered;  // over white and albedo
uniform textureBuffer reals;
uniform textureBuffer albedos;  // RGBA16F
// The light of photons, over white, is here with has_caustics; no level has seen it. An edge's is in its signal.
uniform textureBuffer caustics;
layout(scalar) writeonly buffer DenoisedSignals { vec4 denoised_signals[]; };
layout(scalar) writeonly buffer DenoisedVariances { vec4 denoised_variances[]; };
layout(scalar) writeonly buffer DenoisedUncovered { vec4 denoised_uncovered[]; };
layout(scalar) writeonly buffer DenoisedReals { vec4 denoised_reals[]; };

const int REACH = int(DENOISE_EDGE_REACH);

// The change of a pixel: of the object that covers a share of it, and behind.
struct Parts {
  Pixel pixel;
  vec3 covered;    // mean(M Lm)
  vec3 uncovered;  // mean((1 - M)(Lm - Lr))
};

vec3 albedo_at(ivec2 at) { return texelFetch(albedos, pixel_index(at)).rgb; }

vec3 caustic_at(ivec2 at) {
  return denoise.has_caustics != 0u ? texelFetch(caustics, pixel_index(at)).rgb : vec3(0.0);
}

// Returns the pixel with its albedo and with the light of photons.
Pixel load_lit(ivec2 at) {
  Pixel p = load_pixel(at);
  const vec3 albedo = albedo_at(at);
  p.signal = p.signal * albedo + caustic_at(at);
  p.variance *= albedo * albedo;
  return p;
}

vec3 uncovered_at(ivec2 at) {
  const vec3 own = texelFetch(uncovered, pixel_index(at)).rgb * albedo_at(at);
  return texelFetch(surfaces, pixel_index(at)).w > 0.0 ? own : own + caustic_at(at);
}

Parts load_parts(ivec2 at) {
  Parts p;
  p.pixel = load_lit(at);
  const vec3 own = min(uncovered_at(at), DENOISE_MOST_WHITES);
  p.uncovered = p.pixel.cover >= 1.0 ? vec3(0.0) : p.pixel.cover <= 0.0 ? p.pixel.signal : own;
  p.covered = p.pixel.signal - p.uncovered;
  return p;
}

// Light of the object where it covers all, and the change where nothing covers, as the mean of the
// pixels around.
struct Sides {
  vec3 object, behind;
  vec3 object_variance, behind_variance;
};

// A side that is nowhere around counts as this part of a pixel, with no light.
const float LEAST_PART = 1e-6;

// Returns the weight of a pixel at a distance. With a history the pixels around have little noise, and
// the nearest know best.
float nearness(ivec2 off) {
  return denoise.has_history != 0u ? 1.0 / (1.0 + float(off.x * off.x + off.y * off.y)) : 1.0;
}

Sides sides_around(ivec2 at) {
  Sides s = Sides(vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
  float object = 0.0;
  float behind = 0.0;
  for (int y = -REACH; y <= REACH; ++y)
    for (int x = -REACH; x <= REACH; ++x) {
      if (!is_inside(at + ivec2(x, y))) continue;
      const Parts p = load_parts(at + ivec2(x, y));
      const float cover = p.pixel.cover;
      if (cover > 1.0) continue;  // a highlight
      // The noise of a part is taken to be its share of the pixel's.
      const vec3 variance = p.pixel.overlap * p.pixel.variance;
      const float near = nearness(ivec2(x, y));
      s.object += near * p.covered;
      s.object_variance += near * near * cover * variance;
      object += near * cover;
      s.behind += near * p.uncovered;
      s.behind_variance += near * near * (1.0 - cover) * variance;
      behind += near * (1.0 - cover);
    }
  object = max(object, LEAST_PART);
  behind = max(behind, LEAST_PART);
  s.object /= object;
  s.behind /= behind;
  s.object_variance /= object * object;
  s.behind_variance /= behind * behind;
  return s;
}

// Returns how much of what the edge's pixels are off the sides' mixture is noise, from 0 to 1.
float noise_share(ivec2 at, Sides s) {
  vec3 expected = vec3(0.0);
  vec3 found = vec3(0.0);
  for (int y = -REACH; y <= REACH; ++y)
    for (int x = -REACH; x <= REACH; ++x) {
      if (!is_inside(at + ivec2(x, y))) continue;
      const Pixel p = load_lit(at + ivec2(x, y));
      if (!is_edge(p)) continue;
      const vec3 off = p.signal - mix(s.behind, s.object, p.cover);
      expected += p.overlap * p.variance;
      found += off * off;
    }
  const float off = found.r + found.g + found.b;
  return off > 0.0 ? min((expected.r + expected.g + expected.b) / off, 1.0) : 0.0;
}

// The result for a pixel.
struct Shown {
  vec3 signal, uncovered;
  vec4 variance;
};

// Mixes the sides by the pixel's own share, as far as noise explains that it is another mixture.
void mix_edge(ivec2 at, Parts here, inout Shown shown) {
  const float cover = here.pixel.cover;
  const Sides sides = sides_around(at);
  const float share = noise_share(at, sides);
  const vec3 behind = (1.0 - cover) * sides.behind;
  shown.signal = mix(shown.signal, cover * sides.object + behind, share);
  shown.uncovered = mix(shown.uncovered, behind, share);
  const vec3 left = cover * cover * sides.object_variance +
                    (1.0 - cover) * (1.0 - cover) * sides.behind_variance;
  shown.variance.rgb = (1.0 - share) * (1.0 - share) * shown.variance.rgb +
                       share * share * left / max(shown.variance.w, 1e-6);
}

// Mixes the sides by the share that rays have found. A pixel that is whole by its samples knows one
// side itself.
void mix_anew(ivec2 at, Parts here, float cover, inout Shown shown) {
  const Sides sides = sides_around(at);
  const bool is_object = here.pixel.cover == 1.0;
  const bool is_behind = here.pixel.cover == 0.0;
  const vec3 object = is_object ? here.pixel.signal : sides.object;
  shown.uncovered = (1.0 - cover) * (is_behind ? here.pixel.signal : sides.behind);
  shown.signal = cover * object + shown.uncovered;
  const vec3 variance = here.pixel.overlap * here.pixel.variance;
  const vec3 left =
      cover * cover * (is_object ? variance : sides.object_variance) +
      (1.0 - cover) * (1.0 - cover) * (is_behind ? variance : sides.behind_variance);
  shown.variance = vec4(left, 1.0);
}

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= denoise.width * denoise.height) return;
  const ivec2 at = ivec2(index % denoise.width, index / denoise.width);
  const Parts here = load_parts(at);
  Shown shown = Shown(here.pixel.signal, uncovered_at(at),
                      vec4(here.pixel.variance, here.pixel.overlap));
  // It is 1 and what history_cover.comp has found, or 0 where that has found nothing.
  const float found = denoise.has_history != 0u ? texelFetch(albedos, int(index)).w : 0.0;
  if (found >= 1.0)
    mix_anew(at, here, found - 1.0, shown);
  else if (is_edge(here.pixel))
    mix_edge(at, here, shown);
  denoised_signals[index] = vec4(shown.signal, here.pixel.inverse_depth);
  denoised_variances[index] = shown.variance;
  if (denoise.has_companions == 0u) return;
  denoised_uncovered[index] = vec4(shown.uncovered, 0.0);
  denoised_reals[index] = vec4(texelFetch(reals, int(index)).rgb * albedo_at(at), 0.0);
}
