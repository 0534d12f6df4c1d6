// Random numbers for the reference tracer: splitmix64 (Steele, Lea, Flood 2014), one stream a
// pixel.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>

namespace previz::truth {

class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) : state_(mix(mix(seed) + stream)) {}

  // Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  glm::dvec2 uniform2() {
    const double x = uniform();
    return {x, uniform()};
  }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }
  std::uint64_t next() { return mix(state_ += 0x9e3779b97f4a7c15ULL); }

  std::uint64_t state_;
};

}  // namespace previz::truth
