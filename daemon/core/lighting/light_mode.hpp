// Applies lighting.mode: the image stays as it is, or its light sources become lamps of their own
// beside the rest.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/lighting/source_tracker.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::lighting {

// Applies the mode to an image:
//   image    nothing changes.
//   hybrid   the sources are taken out of the environment, which keeps the rest.
//   sources  the sources are taken out too, and the rest is blurred (sources.hpp) or, with
//            residual = "dropped", black; its share of the light is then in the report.
// Unless light is dropped, sources and environment together have the image's flux. `declared` are
// sources that were taken out of the environment before (Claims::take_out); they come first.
// Returns the texels of each Source::region.
std::vector<std::vector<std::uint32_t>> apply_mode(Lighting& lighting,
                                                   const set::Lighting& settings,
                                                   SourceTracker& tracker,
                                                   std::int64_t timestamp_ns,
                                                   std::vector<Source> declared = {});

// Returns the distance (metres) from the viewpoint to a source in this direction; nothing: at
// infinity.
using SourceDistance = std::function<std::optional<double>(const glm::dvec3& direction)>;

// Returns a lamp for each source, the same in both worlds: a distant disc, or a sphere at its
// distance from `viewpoint` (world, metres), which sends the viewpoint the same flux under the
// same solid angle. Its name, "found 1", has the source's id. A sphere too has the direction, away
// from the source, and the angular radius.
std::vector<set::Light> lamps_of(const std::vector<Source>& sources, const glm::dvec3& viewpoint,
                                 const SourceDistance& distance_of);

}  // namespace previz::lighting
