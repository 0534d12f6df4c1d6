// Drives a camera through a bracket of exposures, and decides which exposures are different places
// of a bracket.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "drivers/camera.hpp"

namespace previz {

// Returns a camera that asks for the next exposure of `exposures_s` (shutter seconds, gain 1; at
// least one) after every frame, beginning with the first at each start. Frames carry the exposure
// that they really have; how many frames are lost between two exposures depends on the device (see
// Camera::set_exposure). If the device refuses an exposure, the old one stays and DeviceTrouble is
// reported, once. set_exposure() returns false. start() throws previz::Error if the camera's
// exposure cannot be driven.
std::unique_ptr<Camera> bracket(std::unique_ptr<Camera> camera, std::vector<double> exposures_s);

// Returns the step of an exposure; exposures of the same step share one place of a bracket. A step
// is 1 %, so that an automatic exposure that wanders does not pile up frames. `exposure` is above
// 0.
long exposure_step(double exposure);

// If an automatic exposure wanders, only the newest steps are kept, at most this many.
inline constexpr std::size_t most_exposures = 24;

}  // namespace previz
