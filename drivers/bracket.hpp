// Brackets of exposures: a camera that takes its exposures in turn, and which exposures are
// different ones to whoever keeps the frames of a bracket.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "drivers/camera.hpp"

namespace previz {

// After every frame the next exposure of `exposures_s` (shutter seconds, gain 1; at least one) is
// asked for, from the first on at each start. Frames say the exposure they really have; how many
// are lost between two exposures is the device's matter (see Camera::set_exposure). Where it
// refuses one, the exposure stays and DeviceTrouble is reported, once. set_exposure() returns
// false. Throws previz::Error, from start(), if the camera's exposure cannot be driven.
std::unique_ptr<Camera> bracket(std::unique_ptr<Camera> camera, std::vector<double> exposures_s);

// Exposures of the same step belong to one place of a bracket. A step is 1 %, so that an automatic
// exposure that wanders does not pile up frames. `exposure` is above 0.
long exposure_step(double exposure);

// Of an automatic exposure that wanders, the newest of this many steps are kept.
inline constexpr std::size_t most_exposures = 24;

}  // namespace previz
