// Makes the counts of a digit, one of each block, the places of the first key with that digit: an
// exclusive prefix sum over the digits, and over the blocks of each. A work group has a digit.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon_sort.glsl"

shared uint sums[WORKGROUP_SIZE];        // of the counts that an invocation has
shared uint lower_sums[WORKGROUP_SIZE];  // of the keys that have a lower digit

uint sum_of_lower(uint lane, uint digit) {
  uint sum = 0u;
  for (uint lower = lane; lower < digit; lower += WORKGROUP_SIZE)
    sum += photon_control.totals[batch.photon_digit * PHOTON_DIGITS + lower];
  return sum;
}

void main() {
  const uint lane = gl_LocalInvocationIndex;
  const uint digit = gl_WorkGroupID.x;
  const uint blocks = (key_count() + BLOCK_KEYS - 1u) / BLOCK_KEYS;
  const uint run = (blocks + WORKGROUP_SIZE - 1u) / WORKGROUP_SIZE;
  const uint first = min(lane * run, blocks);
  const uint end = min(first + run, blocks);
  uint sum = 0u;
  for (uint block = first; block < end; ++block) sum += photon_counts[count_index(digit, block)];
  sums[lane] = sum;
  lower_sums[lane] = sum_of_lower(lane, digit);
  barrier();
  uint place = 0u;
  for (uint i = 0u; i < WORKGROUP_SIZE; ++i) place += lower_sums[i] + (i < lane ? sums[i] : 0u);
  for (uint block = first; block < end; ++block) {
    const uint count = photon_counts[count_index(digit, block)];
    photon_counts[count_index(digit, block)] = place;
    place += count;
  }
  // The first pass leaves out what is not stored, so its last place is the number of the rest. No
  // invocation of this dispatch needs it: the first pass sees all slots.
  if (is_first_pass() && digit == PHOTON_DIGITS - 1u && lane == WORKGROUP_SIZE - 1u)
    photon_control.stored = place;
}
