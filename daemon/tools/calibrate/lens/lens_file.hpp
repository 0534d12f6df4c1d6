// Reads the lenses that other programs calibrate: OpenCV, ROS, Kalibr, COLMAP and others.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "daemon/core/session/files.hpp"
#include "daemon/tools/calibrate/lens/file_lens.hpp"

namespace previz::calibrate {

inline constexpr session::FileKind lens_file_kind{"a file with a lens alone", 1 << 20};

// Recognises the format by the content. `file` is for messages. Throws previz::Error with file, key
// and, where the parser knows it, line: for bytes that are not a calibration, and for formats that
// are refused by name (COLMAP's cameras.bin, and the table of lens_file_programs.cpp).
// Conventions, each as documented by its program:
// - OpenCV (calib3d, "Camera Calibration and 3D Reconstruction", and "Fisheye camera model"): the
//   coefficients are k1, k2, p1, p2[, k3[, k4, k5, k6[, s1..s4[, tx, ty]]]], of a fisheye k1..k4;
//   pixel (0,0) is the centre of the first pixel.
// - ROS (sensor_msgs/CameraInfo; REP 104): plumb_bob and rational_polynomial are OpenCV's 5 and 8
//   coefficients, equidistant is OpenCV's fisheye.
// - Kalibr (wiki, "Supported models", "YAML formats"): intrinsics are fu, fv, pu, pv; radtan has
//   OpenCV's k1, k2, p1, p2, equidistant those of its fisheye.
// - COLMAP (documentation, "Camera Models" and "Output Format"; colmap/sensor/models.h): OPENCV,
//   FULL_OPENCV, OPENCV_FISHEYE and what they contain; (0,0) is the corner of the first pixel, and
//   its centre is (0.5, 0.5).
// - Metashape (user manual, "Camera models", frame cameras): cx and cy count from the centre of the
//   picture's area, fx is f + b1 and fy is f, p1 and p2 are OpenCV's p2 and p1.
// - nerfstudio and instant-ngp ("Data conventions"): OpenCV's models, COLMAP's pixels.
// - RealSense (librealsense, rs_types.h and rsutil.h): Brown-Conrady and KB4 are OpenCV's models.
LensFile read_lens_file(std::string_view bytes, const std::string& file);

// Returns the camera of this name, or else of this index (from 0); the only one if there is no
// choice. Throws previz::Error listing the cameras, or with the camera's refusal.
const FileLens& chosen_lens(const LensFile& read, const std::optional<std::string>& camera,
                            const std::string& file);

}  // namespace previz::calibrate
