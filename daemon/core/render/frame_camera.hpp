// Describes the camera of a frame to the shaders.
#pragma once

#include <glm/mat4x4.hpp>

#include "drivers/calibration.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// Sets what `frame` says of the camera: its rotation, the picture's size in pixels and the lens.
// `world_from_camera` has OpenCV's axes and is in metres.
void describe_camera(gpu::GpuFrame& frame, const ObserverCalibration& calibration,
                     const glm::dmat4& world_from_camera);

}  // namespace previz::render
