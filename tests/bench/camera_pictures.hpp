// Pictures as a camera delivers them, for benchmarks of what keeps pictures: the demo's film camera
// enlarged, with the noise of a sensor.
#pragma once

#include <filesystem>
#include <vector>

#include "drivers/frame.hpp"

namespace previz::bench {

// Returns `count` frames of the source "observer", of the session's frames in turn. Noise is that
// of light and of the sensor's reading: its variance is 1 + 0.01 v at level v of 255. The format is
// yuv422p8 or gray8. Throws previz::Error if the session cannot be read.
std::vector<FramePtr> camera_pictures(const std::filesystem::path& session, PixelFormat format,
                                      int width, int height, int count);

}  // namespace previz::bench
