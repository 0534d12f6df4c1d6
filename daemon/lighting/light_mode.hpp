// lighting.mode: the image as it is, or its light sources as lamps of their own beside what is
// left.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/lighting/environment.hpp"
#include "daemon/lighting/source_tracker.hpp"
#include "daemon/set/set.hpp"

namespace previz::lighting {

// Of an image:
//   image    nothing changes.
//   hybrid   its sources are taken out of the environment, which keeps the rest.
//   sources  so are they, and the rest is blurred (sources.hpp) or, with residual = "dropped",
//            black; its share of the light is then in the report.
// Where nothing is dropped, sources and environment together have the image's flux.
void apply_mode(Lighting& lighting, const set::Lighting& settings, SourceTracker& tracker,
                std::int64_t timestamp_ns);

// How far from the viewpoint a source in this direction is, metres; nothing: at infinity.
using SourceDistance = std::function<std::optional<double>(const glm::dvec3& direction)>;

// A lamp for each source, the same in both worlds: a distant disc, or a sphere at its distance from
// `viewpoint` (world, metres) that sends there the same flux under the same solid angle.
std::vector<set::Light> lamps_of(const std::vector<Source>& sources, const glm::dvec3& viewpoint,
                                 const SourceDistance& distance_of);

}  // namespace previz::lighting
