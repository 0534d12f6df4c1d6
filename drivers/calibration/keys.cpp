#include "drivers/calibration/keys.hpp"

#include <type_traits>
#include <utility>

namespace previz::calibration {
namespace {

using namespace units;
using Keys = std::vector<Key>;

Need required(const char* example) {
  return {Need::Kind::required, example};
}
Need optional(const char* example) {
  return {Need::Kind::optional, example};
}

// What no lens has is refused where it is written.
constexpr Rule focal_px = px.within(1, 1e6);
constexpr Rule principal_px = px.within(-max_picture_side_px, 2 * max_picture_side_px);
constexpr Rule distortion = plain.within(-1e9, 1e9);  // large where little of a long lens is used
constexpr Rule place = m.within(-far_m, far_m);

// One row, one line.
// clang-format off

Keys pinhole_keys(PinholeIntrinsics& i) {
  return {
      {"intrinsics", "width", &i.width, px.within(1, max_picture_side_px), "Size of the calibrated picture.", required("1920")},
      {"intrinsics", "height", &i.height, px.within(1, max_picture_side_px), "Size of the calibrated picture.", required("1080")},
      {"intrinsics", "fx", &i.fx, focal_px, "Focal length along the rows.", required("1850.0")},
      {"intrinsics", "fy", &i.fy, focal_px, "Focal length along the columns.", required("1850.0")},
      {"intrinsics", "cx", &i.cx, principal_px, "Principal point; 0 is the centre of the leftmost pixels.", required("959.5")},
      {"intrinsics", "cy", &i.cy, principal_px, "Principal point; 0 is the centre of the topmost pixels.", required("539.5")},
      {"intrinsics", "k1", &i.k1, distortion, "Radial distortion (Brown-Conrady, OpenCV's order)."},
      {"intrinsics", "k2", &i.k2, distortion, "Radial distortion."},
      {"intrinsics", "p1", &i.p1, distortion, "Tangential distortion."},
      {"intrinsics", "p2", &i.p2, distortion, "Tangential distortion."},
      {"intrinsics", "k3", &i.k3, distortion, "Radial distortion."},
      {.table = "intrinsics", .name = "k4", .to = &i.k4, .rule = distortion, .about = "Radial distortion of OpenCV's rational model, for wide lenses: points r off the axis are drawn by (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6).", .is_recorded_if_not_zero = true},
      {.table = "intrinsics", .name = "k5", .to = &i.k5, .rule = distortion, .about = "Radial distortion of the rational model.", .is_recorded_if_not_zero = true},
      {.table = "intrinsics", .name = "k6", .to = &i.k6, .rule = distortion, .about = "Radial distortion of the rational model.", .is_recorded_if_not_zero = true},
  };
}

Keys fisheye_keys(FisheyeIntrinsics& i) {
  return {
      {"intrinsics", "width", &i.width, px.within(1, max_picture_side_px), "Size of the calibrated picture.", required("1024")},
      {"intrinsics", "height", &i.height, px.within(1, max_picture_side_px), "Size of the calibrated picture.", required("1024")},
      {"intrinsics", "fx", &i.fx, focal_px, "Focal length along the rows (Kannala-Brandt, OpenCV's fisheye).", required("290.0")},
      {"intrinsics", "fy", &i.fy, focal_px, "Focal length along the columns.", required("290.0")},
      {"intrinsics", "cx", &i.cx, principal_px, "Principal point; 0 is the centre of the leftmost pixels.", required("511.5")},
      {"intrinsics", "cy", &i.cy, principal_px, "Principal point; 0 is the centre of the topmost pixels.", required("511.5")},
      {"intrinsics", "k", &i.k, distortion, "k1 to k4 of r = t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9, t the angle off axis."},
      {"intrinsics", "max_angle_deg", &i.max_angle_rad, deg.within(1, 180), "Angle off axis up to which the calibration is valid; nothing is used beyond it.", required("100.0"), "max_angle_rad"},
  };
}

Keys lens_keys(ThinLens& l) {
  return {
      {"lens", "focal_length_mm", &l.focal_length_m, mm.within(0.01, 1e4), "Focal length as engraved on the lens.", required("35.0"), "lens.focal_length_m"},
      {"lens", "f_number", &l.f_number, plain.within(0.5, 1e6), "The f-stop; no lens in air is faster than 0.5.", required("2.8"), "lens.f_number"},
      {"lens", "focus_distance_m", &l.focus_distance_m, m.within(1e-6, far_m), "Distance in focus, along the optical axis; above the focal length. 1e6 for infinity.", required("1.2"), "lens.focus_distance_m"},
  };
}

Keys pose_keys(PoseDraft& p) {
  return {
      {"pose", "position_m", &p.position, place, "Position in the world (Z up). Required unless world_from_camera is given.", optional("[0.5, 0.0, 1.6]"), ""},
      {"pose", "rotation_deg", &p.rotation, deg.within(-36'000, 36'000), "Rotation about world X, then Y, then Z. Without it the camera looks straight up, the right of the picture is X and its bottom is Y.", optional("[0.0, 0.0, 0.0]"), ""},
      {"pose", "world_from_camera", &p.matrix, plain.within(-far_m, far_m), "Instead of both: the rigid transform; camera axes as in OpenCV (right, down, forward).", optional("[[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 1.6], [0, 0, 0, 1]]")},
  };
}

Keys response_keys(ResponseCurve& r, double& responsivity) {
  using enum ResponseCurve::Kind;
  return {
      {"response", "kind", &r.kind, plain, "Curve from signal (exposure * radiance) to picture value.", {}, "response.kind"},
      {"response", "gamma", &r.gamma, plain.within(0.1, 10), "With kind \"gamma\" only: value = signal^(1/gamma).", optional("2.2"), "response.gamma", gamma},
      {"response", "table", &r.inverse_table, plain.within(0, 1), "With kind \"table\" only: signal at value i/(n-1), strictly increasing from 0 to 1.", optional("[0.0, 0.05, 0.22, 0.52, 1.0]"), "response.inverse_table", table},
      {"response", "responsivity", &responsivity, plain.within(1e-12, 1e12), "exposure = shutter time in s * gain * responsivity."},
  };
}

Keys clip_keys(ResponseCurve& r, const char* about) {
  return {
      {"response", "clip_share", &r.clip_share, plain.within(0.5, 1), about, {}, "response.clip_share", {}, true},
  };
}

Keys shading_keys(LightCameraCalibration& c) {
  return {
      {"intrinsics", "vignetting", &c.vignetting, plain.within(-1e6, 1e6), "v1 to v3 of the fraction of light that the lens passes, 1 + v1 t^2 + v2 t^4 + v3 t^6, where t is the angle off axis in radians (previz calibrate vignetting).", {}, "vignetting", {}, true},
      {"response", "dark_level", &c.dark_level, plain.within(0, max_dark_level), "Signal of red, green and blue when the lens is covered, as a fraction of white (previz calibrate dark).", {}, "dark_level", {}, true},
  };
}

constexpr auto observer_clips = "A pixel at or above this fraction of the largest picture value is clipped: it means at least that much light. Lower it if white areas stay below it, as in compressed or limited-range video (previz calibrate response --camera observer measures it).";
constexpr auto light_camera_clips = "A pixel at or above this fraction of the largest picture value is clipped: it means at least that much light, and a shorter exposure of the bracket measures it. Lower it if lamps stay below it, as in compressed or limited-range video (previz calibrate response --camera light measures it).";

// clang-format on

Keys joined(std::initializer_list<Keys> parts) {
  Keys all;
  for (const Keys& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

}  // namespace

std::string Key::allowed(Format format) const {
  return std::visit(
      [&]<class T>(T*) { return Codec<std::remove_cv_t<T>>::describe(bounds(format)); }, to);
}

std::vector<Key> keys(ObserverDraft& draft) {
  ObserverCalibration& c = draft.calibration;
  return joined({pinhole_keys(c.intrinsics), response_keys(c.response, c.responsivity),
                 clip_keys(c.response, observer_clips), lens_keys(draft.lens)});
}

std::vector<Key> keys(LightCameraDraft& draft) {
  LightCameraCalibration& c = draft.calibration;
  return joined({fisheye_keys(c.intrinsics), pose_keys(draft.pose),
                 response_keys(c.response, c.responsivity),
                 clip_keys(c.response, light_camera_clips), shading_keys(c)});
}

}  // namespace previz::calibration
