// A camera's calibration: lens, pose and response, as plain data that sessions and sets hold.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

namespace previz {

// Pinhole with Brown-Conrady distortion in OpenCV's order, and the divisor of its rational model:
// a point r off the axis is drawn by (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6
// r^6). Pixels; (0,0) is the centre of the top-left pixel.
struct PinholeIntrinsics {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
  double k4 = 0, k5 = 0, k6 = 0;
};

// Kannala-Brandt (OpenCV fisheye): r = t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9, t the angle off axis,
// u = cx + fx r cos(psi), v = cy + fy r sin(psi). Invalid beyond max_angle_rad.
struct FisheyeIntrinsics {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 4> k{};
  double max_angle_rad = std::numbers::pi / 2;
};

// Thin lens with a circular uniform aperture of diameter focal_length_m / f_number; the intrinsics
// are those of the sharp image. Distances along the optical axis.
struct ThinLens {
  double focal_length_m = 0;
  double f_number = 0;
  double focus_distance_m = 0;

  friend bool operator==(const ThinLens&, const ThinLens&) = default;
};

// The camera's response: value in [0,1] = forward(exposure * radiance), clipped at 1.
struct ResponseCurve {
  enum class Kind { srgb, linear, gamma, table };
  Kind kind = Kind::srgb;
  double gamma = 2.2;  // Kind::gamma only: value = signal^(1/gamma)
  // Kind::table only: signal at value i/(n-1), i = 0..n-1; strictly increasing from 0 to 1.
  std::vector<double> inverse_table;
  // A value of this share of the largest one or more is clipped: it means at least so much light.
  // Conversion, compression and limited range put what the sensor clipped below the largest value.
  double clip_share = 0.98;
};

// The signal of a value 0..1 by the sRGB curve (IEC 61966-2-1).
double srgb_signal(double value);

struct ObserverCalibration {
  PinholeIntrinsics intrinsics;
  std::optional<ThinLens> lens;  // absent: pinhole
  ResponseCurve response;
  double responsivity = 1.0;  // exposure = exposure_s * gain * responsivity
};

// The light that a lens passes at an angle t off its axis, relative to what it passes on the axis:
// 1 + v1 t^2 + v2 t^4 + v3 t^6.
using Vignetting = std::array<double, 3>;

double relative_illumination(const Vignetting& v, double angle_rad);
// Returns the least relative illumination from the axis to `max_angle_rad` off it.
double least_illumination(const Vignetting& v, double max_angle_rad);

// Values beyond these bounds mean a broken lens or sensor, or a wrong calibration.
inline constexpr double min_illumination = 0.01, max_dark_level = 0.5;

// value = forward(exposure * radiance * relative_illumination + dark_level), clipped at 1.
struct LightCameraCalibration {
  FisheyeIntrinsics intrinsics;
  Vignetting vignetting{};  // at least min_illumination up to intrinsics.max_angle_rad
  // Unless it was measured otherwise, only the largest value counts as clipped.
  ResponseCurve response{.inverse_table = {}, .clip_share = 1};
  double responsivity = 1.0;
  glm::dvec3 dark_level{0};  // signal of a covered lens, per channel, 0 to max_dark_level
  // Rigid; OpenCV camera axes (x right, y down, z forward); metres; world Z up.
  glm::dmat4 world_from_camera{1.0};
};

}  // namespace previz
