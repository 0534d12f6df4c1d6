// Counts the digits of each block of keys, and of all.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon_sort.glsl"

shared uint digits[PHOTON_DIGITS];

void main() {
  const uint lane = gl_LocalInvocationIndex;
  const uint block = gl_WorkGroupID.x;
  if (block * BLOCK_KEYS >= key_count()) return;
  for (uint digit = lane; digit < PHOTON_DIGITS; digit += WORKGROUP_SIZE) digits[digit] = 0u;
  barrier();
  const uint end = min((block + 1u) * BLOCK_KEYS, key_count());
  for (uint place = block * BLOCK_KEYS + lane; place < end; place += WORKGROUP_SIZE) {
    const uint key = key_at(place).x;
    if (key != NO_INDEX) atomicAdd(digits[digit_of(key)], 1u);
  }
  barrier();
  for (uint digit = lane; digit < PHOTON_DIGITS; digit += WORKGROUP_SIZE) {
    const uint count = digits[digit];
    photon_counts[count_index(digit, block)] = count;
    if (count > 0u) atomicAdd(photon_control.totals[batch.photon_digit * PHOTON_DIGITS + digit], count);
  }
}
