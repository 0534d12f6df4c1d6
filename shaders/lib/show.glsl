// The passes that make the shown picture share the rule of the composite (shaders/README.md, "The
// composite"; daemon/core/render/picture/composite.cpp has it in double precision).
#ifndef PREVIZ_SHOW_GLSL
#define PREVIZ_SHOW_GLSL

#include "shaders/lib/plate.glsl"
#include "shaders/lib/response.glsl"

layout(local_size_x = WORKGROUP_SIZE) in;

layout(scalar, push_constant) uniform Show { GpuShow show; };

// Gains are limited to this: a larger ratio means nothing, and its square would overflow.
const float MOST_GAIN = 1e15;

// What the camera measured at a pixel.
struct Measured {
  vec3 radiance;
  vec3 variance;  // what rounding to codes leaves; 0 unless the rule asks for it
  vec3 clipped;   // 0 to 1: how far the code stands for "at least this much"
};

// Returns the linear radiance of codes; that of the largest code is white to the last bit.
vec3 radiance_of(uvec3 codes) {
  return show.white * vec3(signal_of[codes.r], signal_of[codes.g], signal_of[codes.b]);
}

// Returns step^2 / 12, the variance of a uniform distribution, with the mean step to the two
// neighbouring codes.
vec3 variance_of_codes(uvec3 codes) {
  const uvec3 low = max(codes, 1u) - 1u;
  const uvec3 high = min(codes + 1u, show.most);
  const vec3 step = (radiance_of(high) - radiance_of(low)) / vec3(high - low);
  return step * step / 12.0;
}

Measured measured_at(uint index_in_band) {
  if (show.has_plate == 0u) return Measured(vec3(0.0), vec3(0.0), vec3(0.0));
  const uvec3 codes = plate_codes(show.in_picture + index_in_band);
  const vec3 above = vec3(codes) - float(show.clip_from) + 1.0;
  return Measured(radiance_of(codes),
                  show.composite == COMPOSITE_HYBRID ? variance_of_codes(codes) : vec3(0.0),
                  clamp(above / (float(show.clip_at - show.clip_from) + 1.0), 0.0, 1.0));
}

// Returns the factor by which the difference is multiplied before it is added to the camera's
// radiance. For hybrid, both terms are first divided by the larger one, because their squares could
// overflow.
float gain(float camera, float real, float variance) {
  if (show.composite == COMPOSITE_RATIO) return real > 0.0 ? min(camera / real, MOST_GAIN) : 0.0;
  if (show.composite == COMPOSITE_HYBRID) {
    const float spread = sqrt(variance + show.floor * show.floor);
    const float most = max(real, spread);
    if (!(most > 0.0)) return 1.0;
    const float r = real / most;
    const float s = spread / most;
    return min((r * (camera / most) + s * s) / (r * r + s * s), MOST_GAIN);
  }
  return 1.0;
}

// What the samples, filtered or not, say about a pixel.
struct Estimate {
  vec3 change;     // composite - (1 - mean(M)) Lc, by the additive rule
  float mask;      // mean(M)
  vec3 uncovered;  // mean((1 - M)(Lm - Lr)), the part of `change` that the rule multiplies
  vec3 real;       // mean(Lr)
};

// Returns the composite, which is below 0 where the model's real world is so much brighter than the
// picture that a shadow takes more light than is there: no light is shown there. A clipped channel of the plate stands for the model's radiance where that
// is brighter, but what comes out is then no brighter than the plate or the plain composite: light
// that the sensor could not show is used up by shadows and never added.
vec3 compose(Measured camera, Estimate e) {
  vec3 result;
  for (uint c = 0u; c < 3u; ++c) {
    const float seen = camera.radiance[c];
    const float extra = gain(seen, e.real[c], camera.variance[c]) - 1.0;
    const float plain = (1.0 - e.mask) * seen + (e.change[c] + extra * e.uncovered[c]);
    result[c] = plain;
    if (camera.clipped[c] <= 0.0) continue;
    const float behind = seen + camera.clipped[c] * max(e.real[c] - seen, 0.0);
    const float extra_behind = gain(behind, e.real[c], camera.variance[c]) - 1.0;
    const float whole = (1.0 - e.mask) * behind + (e.change[c] + extra_behind * e.uncovered[c]);
    result[c] = min(whole, max(seen, plain));
  }
  return result;
}

#endif
