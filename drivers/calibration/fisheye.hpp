// Kannala-Brandt fisheye projection both ways, exact beyond 90 degrees off axis.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz {

// Camera axes as OpenCV's (x right, y down, z forward); (0,0) is the centre of the top-left pixel.
// Source of the model: Kannala and Brandt 2006, "A Generic Camera Model and Calibration Method for
// Conventional, Wide-Angle, and Fish-Eye Lenses", in the parametrisation of OpenCV's fisheye.
class Fisheye {
 public:
  // The intrinsics are within the bounds of their keys (calibration/keys.hpp).
  explicit Fisheye(const FisheyeIntrinsics& intrinsics);

  const FisheyeIntrinsics& intrinsics() const { return intrinsics_; }
  // The calibrated angle, or where the polynomial stops growing if that comes first.
  double max_angle_rad() const { return max_angle_rad_; }

  // Pixel of a direction of any length; nothing beyond max_angle_rad(). The pixel may lie outside
  // the picture.
  std::optional<glm::dvec2> project(const glm::dvec3& direction) const;
  // Unit direction of a pixel position; nothing beyond max_angle_rad().
  std::optional<glm::dvec3> unproject(const glm::dvec2& pixel) const;
  // Index (y * width + x) of the pixel that a position lies on; nothing outside the picture and on
  // pixels that are not wholly within max_angle_rad(): those are darkened by the lens's edge.
  std::optional<std::uint32_t> pixel_at(const glm::dvec2& position) const;
  // Solid angle of a pixel on the optical axis, sr.
  double axis_pixel_sr() const { return 1 / (intrinsics_.fx * intrinsics_.fy); }

 private:
  FisheyeIntrinsics intrinsics_;
  double max_angle_rad_ = 0;
  double max_radius_ = 0;  // of the polynomial, at max_angle_rad_
};

// The pixel of a direction of any length by the polynomial alone, whatever max_angle_rad says and
// even where the polynomial has stopped growing: for fitting it. The axis' own pixel straight
// behind the camera.
glm::dvec2 fisheye_pixel(const FisheyeIntrinsics& intrinsics, const glm::dvec3& direction);

// The angle at which r(t) = t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9 stops growing, at most pi.
double monotonic_limit_rad(const std::array<double, 4>& k);

}  // namespace previz
