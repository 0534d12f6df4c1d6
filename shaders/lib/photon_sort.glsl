// Photons are sorted by their bucket, digit by digit from the lowest (LSD radix sort; a pass of it
// after Zagha and Blelloch, "Radix Sort for Vector Multiprocessors", 1991). Every pass keeps the order
// of photons whose digits are equal, so in the end those of a bucket are in the order of their indices,
// and sums over them round alike in every run and in both worlds. The work of an invocation grows
// neither with the photons in one place nor, but for a 64th of the blocks, with all of them.
//
// A work group moves a block of keys, and each of its invocations a run of PHOTON_RUN of them.
#ifndef PREVIZ_PHOTON_SORT_GLSL
#define PREVIZ_PHOTON_SORT_GLSL

#include "shaders/lib/photon.glsl"

const uint BLOCK_KEYS = PHOTON_RUN * WORKGROUP_SIZE;

// For each digit in turn, how many keys of each block have it, and then where the first of them goes.
layout(scalar) buffer Counts { uint photon_counts[]; };

uint slots() { return 2u * frame.photon_count; }
uint block_count() { return (slots() + BLOCK_KEYS - 1u) / BLOCK_KEYS; }
uint count_index(uint digit, uint block) { return digit * block_count() + block; }

// The first pass sees all slots, the others only photons that are stored: the first leaves the rest out.
bool is_first_pass() { return batch.photon_digit == 0u; }
uint key_count() {
  if (is_first_pass()) return slots();
  return photon_control.stored;
}

uint digit_of(uint key) {
  return (key >> (batch.photon_digit * PHOTON_DIGIT_BITS)) & (PHOTON_DIGITS - 1u);
}

// The first pass writes the first half of photon_order, the next reads that and writes the second.
uint half_of_order(uint pass) { return (pass & 1u) * slots(); }

// Returns a bucket, which is NO_INDEX where a slot has no photon, and a photon.
uvec2 key_at(uint place) {
  uvec2 key;
  if (is_first_pass()) key = uvec2(photon_keys[place], place);
  else key = photon_order[half_of_order(batch.photon_digit - 1u) + place];
  return key;
}

#endif
