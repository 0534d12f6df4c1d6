#include "daemon/core/render/frame_camera.hpp"

namespace previz::render {

void describe_camera(gpu::GpuFrame& frame, const ObserverCalibration& calibration,
                     const glm::dmat4& world_from_camera) {
  for (int r = 0; r < 3; ++r) {
    const glm::dmat4& m = world_from_camera;
    frame.world_from_camera[r] = glm::vec4(m[0][r], m[1][r], m[2][r], 0.0);
  }
  frame.width = static_cast<std::uint32_t>(calibration.intrinsics.width);
  frame.height = static_cast<std::uint32_t>(calibration.intrinsics.height);
  if (calibration.lens) {
    const ThinLens& lens = *calibration.lens;
    frame.lens_radius = static_cast<float>(lens.focal_length_m / (2 * lens.f_number));
    frame.focus_distance = static_cast<float>(lens.focus_distance_m);
  }
  // If the lens is only carried, the camera is a pinhole: every ray starts at its centre and aims
  // at a distance of one.
  if (!calibration.lens) frame.focus_distance = 1;
  const PinholeIntrinsics& k = calibration.intrinsics;
  frame.focal_px = {k.fx, k.fy};
  frame.principal_px = {k.cx, k.cy};
  frame.radial = {k.k1, k.k2, k.k3};
  frame.radial_divisor = {k.k4, k.k5, k.k6};
  frame.tangential = {k.p1, k.p2};
}

}  // namespace previz::render
