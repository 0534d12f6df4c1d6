// Draws the cross with which corners are marked, and the corners that are marked already.
#pragma once

#include <glm/mat4x4.hpp>
#include <optional>

#include "daemon/core/live/marking.hpp"
#include "daemon/core/output/guide_page.hpp"
#include "drivers/calibration.hpp"

namespace previz::rig {

// Returns a cross that leaves the middle of the picture free, with the name of the selected corner
// above it. Where the camera is known, also a cross at each corner that was found in space, with
// its numbers, and, of a selected corner that was marked once, the ray of that mark: the corner is
// on it.
output::GuidePage marking_lines(const live::Marking& marking, const PinholeIntrinsics& lens,
                                const std::optional<glm::dmat4>& world_from_camera);

}  // namespace previz::rig
