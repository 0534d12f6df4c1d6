// Moves the keys of each block to their places by one digit. Those with equal digits stay in order,
// because each invocation has a run of keys, and places for them behind those of the runs before.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shaders/lib/photon_sort.glsl"

// The counts of each invocation's run are 16 bits each, those of two digits in a word, to fit into the
// 16 KiB that every device has. They become the numbers of such keys in the block before the run.
const uint WORDS = PHOTON_DIGITS / 2u;
shared uint counts[WORDS * WORKGROUP_SIZE];

// Returns where the counts of a run are. What invocations use at the same time, the same word of all
// runs or all words of a run, is in different banks of a card's memory.
uint place_of(uint run, uint word) { return run * WORDS + (word ^ run); }

// Returns how many of the digit there were, and counts one more.
uint count_one(uint lane, uint digit) {
  const uint word = place_of(lane, digit >> 1);
  const uint shift = (digit & 1u) * 16u;
  const uint before = counts[word];
  counts[word] = before + (1u << shift);
  return (before >> shift) & 0xffffu;
}

void add_up_runs(uint lane) {
  for (uint word = lane; word < WORDS; word += WORKGROUP_SIZE) {
    uint sum = 0u;
    for (uint run = 0u; run < WORKGROUP_SIZE; ++run) {
      const uint count = counts[place_of(run, word)];
      counts[place_of(run, word)] = sum;
      sum += count;
    }
  }
}

void main() {
  const uint lane = gl_LocalInvocationIndex;
  const uint block = gl_WorkGroupID.x;
  if (block * BLOCK_KEYS >= key_count()) return;
  for (uint word = 0u; word < WORDS; ++word) counts[place_of(lane, word)] = 0u;
  const uint first = block * BLOCK_KEYS + lane * PHOTON_RUN;
  const uint end = min(first + PHOTON_RUN, key_count());
  for (uint place = first; place < end; ++place) {
    const uint key = key_at(place).x;
    if (key != NO_INDEX) count_one(lane, digit_of(key));
  }
  barrier();
  add_up_runs(lane);
  barrier();
  for (uint place = first; place < end; ++place) {
    const uvec2 key = key_at(place);
    if (key.x == NO_INDEX) continue;
    const uint digit = digit_of(key.x);
    const uint to = photon_counts[count_index(digit, block)] + count_one(lane, digit);
    photon_order[half_of_order(batch.photon_digit) + to] = key;
  }
}
