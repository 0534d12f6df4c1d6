// A camera that takes its exposures in turn.
#pragma once

#include <memory>
#include <vector>

#include "drivers/camera.hpp"

namespace previz {

// After every frame the next exposure of `exposures_s` (shutter seconds, gain 1; at least one) is
// asked for, from the first on at each start. Frames say the exposure they really have; how many
// are lost between two exposures is the device's matter (see Camera::set_exposure). Where it
// refuses one, the exposure stays and that is trouble, once. set_exposure() returns false.
// Throws previz::Error, from start(), if the camera's exposure cannot be driven.
std::unique_ptr<Camera> bracket(std::unique_ptr<Camera> camera, std::vector<double> exposures_s);

}  // namespace previz
