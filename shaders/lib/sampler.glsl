// Random numbers are padded two-dimensional Owen-scrambled Sobol points, seeded by hashes, without
// tables (Burley 2020, "Practical Hash-based Owen Scrambling"). A sample is a pure function of
// (seed, pixel, sample index, dimension).
//
// The pixels of a tile share a scramble, and each pixel shifts the points, digit by digit, by a
// point of another net, taken in Morton order. So each pixel has a scrambled Sobol sequence, and
// one sample of each of the tile's 64 pixels is a net as well: errors cancel over a tile, which the
// eye and every mean over many pixels see. The idea is that of Ahmed and Wonka 2020, "Screen-Space
// Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels", but
// works for any number of samples.
#ifndef PREVIZ_SAMPLER_GLSL
#define PREVIZ_SAMPLER_GLSL

struct Sampler {
  uint key;    // seeds the scramble of the pixel's tile
  uint index;  // of the sample
  uint place;  // of the pixel in its tile, in Morton order
};

const uint TILE_BITS = 3u;  // tiles of 8x8 pixels

// A finaliser of a 32-bit hash with low bias (Wellons 2018, lowbias32).
uint hash_bits(uint x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x;
}

uint hash_pair(uint a, uint b) { return hash_bits(a ^ (hash_bits(b) + 0x9e3779b9u + (a << 6) + (a >> 2))); }

// Moves bit i to bit 2 i.
uvec2 spread_bits(uvec2 x) {
  x = (x | (x << 2)) & 0x33u;
  return (x | (x << 1)) & 0x55u;
}

Sampler make_sampler(uint seed, uvec2 pixel, uint index) {
  const uvec2 tile = pixel >> TILE_BITS;
  const uvec2 in_tile = spread_bits(pixel & ((1u << TILE_BITS) - 1u));
  return Sampler(hash_pair(hash_pair(seed, tile.x), tile.y), index, in_tile.x | (in_tile.y << 1));
}

// Gives the four pixels of a square of 2x2 to four nets that are independent of one another, each of
// which spreads over the tile as the whole did.
Sampler separate_parts(Sampler s) {
  return Sampler(hash_pair(s.key, s.place & 3u), s.index, s.place >> 2);
}

// The Laine-Karras permutation, which is an Owen scramble of reversed bits (constants by Vegdahl
// 2021).
uint scramble_reversed(uint x, uint seed) {
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return x;
}

// Returns the second Sobol dimension of `index`, its bits not yet reversed. The generator matrix is
// Pascal's triangle modulo 2, a Kronecker power of a 2x2 matrix, so that five steps multiply by it.
uint sobol_second_reversed(uint index) {
  index ^= (index >> 1) & 0x55555555u;
  index ^= (index >> 2) & 0x33333333u;
  index ^= (index >> 4) & 0x0f0f0f0fu;
  index ^= (index >> 8) & 0x00ff00ffu;
  index ^= (index >> 16) & 0x0000ffffu;
  return index;
}

// Uses 24 bits, so that the result is exact and below 1.
float unit_float(uint bits) { return float(bits >> 8) * 5.9604644775390625e-8; }

// Returns a scrambled Sobol point as binary fractions.
uvec2 sobol_bits(uint index, uint key) {
  index = bitfieldReverse(scramble_reversed(bitfieldReverse(index), key));
  // The first Sobol dimension is the reversed index; scrambling takes reversed bits, so the two
  // reversals cancel.
  return uvec2(bitfieldReverse(scramble_reversed(index, hash_bits(key ^ 0xa511e9b3u))),
               bitfieldReverse(scramble_reversed(sobol_second_reversed(index),
                                                 hash_bits(key ^ 0x63d83595u))));
}

// Returns the point of the dimension pair `pair`, in [0, 1)^2.
vec2 sample_2d(Sampler s, uint pair) {
  const uint key = hash_pair(s.key, pair);
  const uvec2 bits = sobol_bits(s.index, key) ^ sobol_bits(s.place, hash_bits(key + 0x9e3779b9u));
  return vec2(unit_float(bits.x), unit_float(bits.y));
}

// Returns whether u falls into the first `share` of [0, 1), and stretches the rest of u to [0, 1)
// for the next decision. So the points of each branch stay as evenly spread as those of the pair,
// which a choice by a separate number would thin out at random.
bool choose(inout float u, float share) {
  const bool first = u < share;
  u = min(first ? u / share : (u - share) / (1.0 - share), 0.99999994);
  return first;
}

// Returns the probability with which Russian roulette lets a path live of whose light this share is left.
// It spares all that is not faint: tests/bench/RESULTS.md, "When faint paths end".
const float FAINT = 0.1;
float survival_of(float left) { return min(left / FAINT, 1.0); }

// The camera has two dimension pairs, and then each vertex has three.
const uint PAIR_PIXEL = 0u;
const uint PAIR_LENS = 1u;
const uint PAIR_LIGHT = 2u;     // which light, and where on it
const uint PAIR_SCATTER = 3u;   // which technique and lobe, and the direction
const uint PAIR_CHANCE = 4u;    // x: roulette, y: whether rough glass reflects
const uint PAIRS_PER_VERTEX = 3u;

// With FEATURE_MANY_LIGHTS each vertex has one more pair, which lies beyond all others. x: whether the
// tree of lamps is taken, y: which lamp.
const uint PAIR_LAMP = 1u << 16;

uint vertex_pair(uint pair, uint depth) { return pair + PAIRS_PER_VERTEX * depth; }

#endif
