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

// An edge has the uncovered part of its change here, over white and albedo. An outline that is mixed anew
// has its other side, over white, and the number of samples of that.
PREVIZ_FETCHED(vec4, uncovered)
PREVIZ_FETCHED(vec4, reals)
PREVIZ_FETCHED_HALVES(albedos)
// The light of photons, over white, is here with has_caustics; no level has seen it. An edge's is in its signal.
PREVIZ_FETCHED(vec4, caustics)
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

vec3 albedo_at(ivec2 at) { return fetch(albedos, pixel_index(at)).rgb; }

vec3 caustic_at(ivec2 at) {
  return denoise.has_caustics != 0u ? fetch(caustics, pixel_index(at)).rgb : vec3(0.0);
}

// Returns the pixel with its albedo and with the light of photons.
Pixel load_lit(ivec2 at) {
  Pixel p = load_pixel(at);
  const vec3 albedo = albedo_at(at);
  p.signal = p.signal * albedo + caustic_at(at);
  p.variance *= albedo * albedo;
  return p;
}

Parts load_parts(ivec2 at) {
  Parts p;
  p.pixel = load_lit(at);
  p.uncovered = p.pixel.signal;
  if (is_edge(p.pixel))
    p.uncovered = min(fetch(uncovered, pixel_index(at)).rgb * albedo_at(at), DENOISE_MOST_WHITES);
  else if (p.pixel.cover == 1.0)
    p.uncovered = vec3(0.0);
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
      s.object += p.covered;
      s.object_variance += cover * variance;
      object += cover;
      s.behind += p.uncovered;
      s.behind_variance += (1.0 - cover) * variance;
      behind += 1.0 - cover;
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

// A mean of so many samples counts as half of a pixel that the levels have filtered.
const float HALF_KNOWING = 8.0;

// Returns the share that rays have found, or less than 0 where they have found none.
float found_at(ivec2 at) { return fetch(albedos, pixel_index(at)).w - 1.0; }

// Returns the mean of an outline's own samples of its other side; the fourth component is how far they know
// it, from 0 to 1.
vec4 kept_other(ivec2 at) {
  const vec4 kept = fetch(uncovered, pixel_index(at));
  return vec4(min(kept.rgb, DENOISE_MOST_WHITES), kept.w / (kept.w + HALF_KNOWING));
}

// Returns what the pixels around show of the other side of an outline, the nearest of which know best.
// The fourth component is the sum of their weights.
vec4 other_around(ivec2 at, float own_cover) {
  vec4 sum = vec4(0.0);
  for (int y = -REACH; y <= REACH; ++y)
    for (int x = -REACH; x <= REACH; ++x) {
      const ivec2 there = at + ivec2(x, y);
      if (!is_inside(there) || (x == 0 && y == 0)) continue;
      const float near = 1.0 / (1.0 + float(x * x + y * y));
      const float cover = fetch(surfaces, pixel_index(there)).w;
      if (cover == 1.0 - own_cover) {
        sum += near * vec4(load_lit(there).signal, 1.0);
      } else if (cover == own_cover && found_at(there) >= 0.0) {
        const vec4 kept = kept_other(there);
        sum += near * kept.w * vec4(kept.rgb, 1.0);
      }
    }
  return sum;
}

// Mixes the two sides of an outline by the share that rays have found. The pixel is filtered as if
// its own side filled it.
void mix_anew(ivec2 at, Pixel here, float found, inout Shown shown) {
  const vec4 kept = kept_other(at);
  const vec4 around = other_around(at, here.cover);
  if (around.w <= 0.0 && kept.w <= 0.0) return;
  // Between a thing and its contact shadow, which may be narrower than a pixel, only the pixel itself knows.
  const vec3 other_light =
      around.w > 0.0 ? mix(around.rgb / around.w, kept.rgb, kept.w) : kept.rgb;
  const bool is_object = here.cover == 1.0;
  const vec3 object = is_object ? here.signal : other_light;
  const vec3 behind = is_object ? other_light : here.signal;
  shown.uncovered = (1.0 - found) * behind;
  shown.signal = found * object + shown.uncovered;
}

void main() {
  const uint index = gl_GlobalInvocationID.x;
  if (index >= denoise.width * denoise.height) return;
  const ivec2 at = ivec2(index % denoise.width, index / denoise.width);
  const Parts here = load_parts(at);
  Shown shown =
      Shown(here.pixel.signal, here.uncovered, vec4(here.pixel.variance, here.pixel.overlap));
  const float found = denoise.has_history != 0u ? found_at(at) : -1.0;
  if (found >= 0.0)
    mix_anew(at, here.pixel, found, shown);
  else if (is_edge(here.pixel))
    mix_edge(at, here, shown);
  denoised_signals[index] = vec4(shown.signal, here.pixel.inverse_depth);
  denoised_variances[index] = shown.variance;
  if (denoise.has_companions == 0u) return;
  denoised_uncovered[index] = vec4(shown.uncovered, 0.0);
  denoised_reals[index] = vec4(fetch(reals, int(index)).rgb * albedo_at(at), 0.0);
}
