// Random numbers: padded two-dimensional Owen-scrambled Sobol points, hash-seeded, without tables
// (Burley 2020, "Practical Hash-based Owen Scrambling"). A sample is a pure function of
// (seed, pixel, sample index, dimension).
#ifndef PREVIZ_SAMPLER_GLSL
#define PREVIZ_SAMPLER_GLSL

struct Sampler {
  uint key;    // of this pixel
  uint index;  // of this sample
};

// Finaliser of a 32-bit hash with low bias (Wellons 2018, lowbias32).
uint hash_bits(uint x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

uint hash_pair(uint a, uint b) { return hash_bits(a ^ (hash_bits(b) + 0x9e3779b9u + (a << 6) + (a >> 2))); }

Sampler make_sampler(uint seed, uvec2 pixel, uint index) {
  return Sampler(hash_pair(hash_pair(seed, pixel.x), pixel.y), index);
}

// Laine-Karras permutation: an Owen scramble of the reversed bits (constants of Vegdahl 2021).
uint scramble_reversed(uint x, uint seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

// The second Sobol dimension of `index`, bits not yet reversed: multiplication by Pascal's triangle
// modulo 2, which is a Kronecker power and so takes one step a bit of the bit position.
uint sobol_second_reversed(uint index) {
  index ^= (index >> 1) & 0x55555555u;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 4) & 0x0f0f0f0fu;
  index ^= (index >> 8) & 0x00ff00ffu;
  index ^= (index >> 16) & 0x0000ffffu;
  return index;
}

// 24 bits, so that the result is below 1 and exact.
float unit_float(uint bits) { return float(bits >> 8) * 5.9604644775390625e-8; }

// Point of dimension pair `pair`, in [0, 1)^2.
vec2 sample_2d(Sampler s, uint pair) {
  const uint key = hash_pair(s.key, pair);
  const uint index = bitfieldReverse(scramble_reversed(bitfieldReverse(s.index), key));
  // Sobol's first dimension is the reversed index; scrambling wants reversed bits, so the two
  // reversals cancel.
  const uint x = bitfieldReverse(scramble_reversed(index, hash_bits(key ^ 0xa511e9b3u)));
  const uint y = bitfieldReverse(
      scramble_reversed(sobol_second_reversed(index), hash_bits(key ^ 0x63d83595u)));
  return vec2(unit_float(x), unit_float(y));
}

// Whether u falls into the first `share` of [0, 1). What remains of u is stretched to [0, 1) again and
// decides what comes next: so the points of each branch stay as evenly spread as those of the pair,
// which a choice by a number of its own would thin at random.
bool choose(inout float u, float share) {
  const bool first = u < share;
  u = min(first ? u / share : (u - share) / (1.0 - share), 0.99999994);
  return first;
}

// Dimension pairs: two for the camera, then three a vertex.
const uint PAIR_PIXEL = 0u;
const uint PAIR_LENS = 1u;
const uint PAIR_LIGHT = 2u;     // which light, and where on it
const uint PAIR_SCATTER = 3u;   // which technique and lobe, and the direction
const uint PAIR_CHANCE = 4u;    // x: roulette, y: whether rough glass reflects
const uint PAIRS_PER_VERTEX = 3u;

uint vertex_pair(uint pair, uint depth) { return pair + PAIRS_PER_VERTEX * depth; }

#endif
