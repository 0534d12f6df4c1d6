// Adds the samples of a batch to their pixels, in the order of the samples, as two-float sums
// (shaders/README.md, "Accumulation").
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/path.glsl"

// Adds x to high + low; only the addition to low rounds (Knuth's TwoSum, then renormalised).
// `precise` forbids the compiler to reassociate.
void add_exactly(inout vec4 high, inout vec4 low, vec4 x) {
  precise const vec4 sum = high + x;
  precise const vec4 part = sum - high;
  precise const vec4 error = (high - (sum - part)) + (x - part);
  precise const vec4 rest = low + error;
  precise const vec4 new_high = sum + rest;
  precise const vec4 new_low = rest - (new_high - sum);
  high = new_high;
  low = new_low;
}

bool is_finite(vec3 v) {
  return !any(isnan(v)) && !any(isinf(v));
}

// Counts a sample that is not finite or is negative, and makes it black in both worlds, for which the
// result is true.
bool reject_impossible(inout vec4 mixed, inout vec4 real, inout vec3 landed) {
  const bool finite = is_finite(mixed.rgb) && is_finite(real.rgb) && is_finite(landed);
  const bool negative = any(lessThan(min(min(mixed.rgb, real.rgb), landed), vec3(0.0)));
  if (finite && !negative) return false;
  if (!finite) atomicAdd(control.dropped_not_finite, 1u);
  else atomicAdd(control.dropped_negative, 1u);
  mixed.rgb = vec3(0.0);
  real.rgb = vec3(0.0);
  landed = vec3(0.0);
  return true;
}

// Returns what photons have added to the change: to Lm where the sample is covered, else to Lm - Lr.
// The fourth component is the variance.
vec4 caustic_of(uint slot, bool covered) {
  const vec4 mixed = sample_caustic[2u * slot];
  const vec4 real = sample_caustic[2u * slot + 1u];
  return covered ? mixed : vec4(mixed.rgb - real.rgb, mixed.w + real.w);
}

// Empties the queue of what is left in it, which is counted: the next batch uses the same slots for
// other samples.
void end_batch() {
  control.unfinished += control.next_count;
  control.next_count = 0u;
}

void main() {
  if (gl_GlobalInvocationID.x == 0u) end_batch();
  if (gl_GlobalInvocationID.x >= batch.width * batch.height) return;
  const uvec2 in_tile = uvec2(gl_GlobalInvocationID.x % batch.width, gl_GlobalInvocationID.x / batch.width);
  const uint limit = sample_limit(uvec2(batch.x, batch.y) + in_tile);
  if (limit <= batch.first_sample) return;
  const uint samples = min(batch.samples, limit - batch.first_sample);
  GpuPixel sums = pixels[gl_GlobalInvocationID.x];
  vec4 caustic = vec4(0.0);
  for (uint s = 0u; s < samples; ++s) {
    const uint slot = s * tile_slots() + pixel_slot(in_tile);
    vec4 mixed = sample_mixed[slot];
    vec4 real = sample_real[slot];
    const vec4 aov = sample_aov[slot];
    vec3 landed = has_feature(FEATURE_CAMERA) ? sample_landed[slot].rgb : vec3(0.0);
    const bool is_rejected = reject_impossible(mixed, real, landed);
    mixed.rgb -= landed;  // from here on it may be negative: it holds Lm - Lr of landed paths
    const vec3 diff = mixed.rgb - real.rgb;
    add_exactly(sums.mixed_high, sums.mixed_low, mixed);
    add_exactly(sums.diff_high, sums.diff_low, vec4(diff, aov.w));
    sums.normal += vec4(aov.xyz, aov.w > 0.0 ? 1.0 : 0.0);
    if (has_feature(FEATURE_TEXTURES | FEATURE_VERTEX_COLORS))
      sums.albedo.rgb += unpack_halves(sample_albedo[slot]);
    const bool covered = mixed.w > 0.0;
    add_exactly(sums.uncovered_high, sums.uncovered_low, vec4(covered ? vec3(0.0) : diff, real.w));
    const vec3 added = covered ? mixed.rgb : diff;
    if (has_feature(FEATURE_PHOTONS) && !is_rejected) caustic += caustic_of(slot, covered);
    add_exactly(sums.square_high, sums.square_low, vec4(added * added, 1.0));
  }
  pixels[gl_GlobalInvocationID.x] = sums;
  if (has_feature(FEATURE_PHOTONS)) pixel_caustics[gl_GlobalInvocationID.x] += caustic;
}
