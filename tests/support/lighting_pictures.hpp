// Pictures and light made by code, for the tests of the lighting room.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "tests/support/units.hpp"

namespace previz::test {

// Radiance from a unit world direction.
using Sky = std::function<glm::dvec3(const glm::dvec3&)>;

// A linear rgb16 frame; signals are row-major, clipped at 1.
FramePtr make_frame(int width, int height, double exposure, const std::vector<glm::dvec3>& signals);
FramePtr make_frame(int width, int height, double exposure,
                    const std::function<glm::dvec3(int x, int y)>& signal_at);

// An rgb8 frame of the light camera.
FramePtr rgb8_frame(int width, double exposure, std::vector<std::uint8_t> codes,
                    std::uint64_t sequence = 12);

// A fisheye of 200 degrees and size x size pixels with the truth sets' kind of polynomial and a
// linear response, looking up.
LightCameraCalibration fisheye_camera(int size = 512,
                                      const glm::dmat4& world_from_camera = glm::dmat4(1));
// Rotation of the camera: its axis at this azimuth and elevation, turned by `roll` about itself.
glm::dmat4 looking(double azimuth_deg, double elevation_deg, double roll_deg = 0);
glm::dvec3 towards(double azimuth_deg, double elevation_deg);

// What the camera records: the mean over a pixel of 2x2 directions, or of 8x8 where those differ
// and `fine` is asked for; black beyond the calibrated angle.
enum class Detail { smooth, fine };
FramePtr photograph(const LightCameraCalibration& camera, const Sky& sky, double exposure,
                    Detail detail = Detail::smooth);

// What fills the light that the camera does not see; the radiance is that of UnseenRule::constant.
set::Lighting unseen_as(set::UnseenRule rule, double radiance = 0);

// 64 unit vectors spread evenly over the upper hemisphere (a spherical Fibonacci lattice).
std::vector<glm::dvec3> upper_normals();

}  // namespace previz::test
