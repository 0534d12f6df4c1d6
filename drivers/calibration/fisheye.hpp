// Projects by the Kannala-Brandt fisheye model, both ways, and exactly beyond 90 degrees off axis.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz {

// Camera axes are OpenCV's (x right, y down, z forward); (0,0) is the centre of the top-left pixel.
// Source of the model: Kannala and Brandt 2006, "A Generic Camera Model and Calibration Method for
// Conventional, Wide-Angle, and Fish-Eye Lenses", in the parametrisation of OpenCV's fisheye.
class Fisheye {
 public:
  // The intrinsics must be within the bounds of their keys (calibration/keys.hpp).
  explicit Fisheye(const FisheyeIntrinsics& intrinsics);

  const FisheyeIntrinsics& intrinsics() const { return intrinsics_; }
  // Returns the calibrated angle, or the angle at which the polynomial stops growing if that is
  // less.
  double max_angle_rad() const { return max_angle_rad_; }

  // Returns the pixel of a direction of any length; nothing beyond max_angle_rad(). The pixel may
  // lie outside the picture.
  std::optional<glm::dvec2> project(const glm::dvec3& direction) const;
  // Returns the unit direction of a pixel position; nothing beyond max_angle_rad().
  std::optional<glm::dvec3> unproject(const glm::dvec2& pixel) const;
  // Returns the index (y * width + x) of the pixel that a position lies on; nothing outside the
  // picture, or on a pixel that is not wholly within max_angle_rad(), where the lens's edge darkens
  // it.
  std::optional<std::uint32_t> pixel_at(const glm::dvec2& position) const;
  // Returns the solid angle of a pixel on the optical axis, sr.
  double axis_pixel_sr() const { return 1 / (intrinsics_.fx * intrinsics_.fy); }

 private:
  FisheyeIntrinsics intrinsics_;
  double max_angle_rad_ = 0;
  double max_radius_ = 0;  // of the polynomial, at max_angle_rad_
};

// Returns the pixel of a direction of any length by the polynomial alone, for fitting it:
// max_angle_rad is ignored, and the polynomial need not grow there. A direction straight behind the
// camera gives the axis' own pixel.
glm::dvec2 fisheye_pixel(const FisheyeIntrinsics& intrinsics, const glm::dvec3& direction);

// Returns the angle at which r(t) = t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9 stops growing, at most
// pi.
double monotonic_limit_rad(const std::array<double, 4>& k);

}  // namespace previz
