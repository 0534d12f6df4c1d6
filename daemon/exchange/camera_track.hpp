// The camera of a take for the crew's other tools: USD, Nuke's .chan.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <iosfwd>
#include <string>
#include <vector>

#include "drivers/calibration.hpp"
#include "drivers/session/session.hpp"

namespace previz::exchange {

struct CameraKey {
  std::uint64_t frame = 0;            // of the take, from 0
  glm::dmat4 world_from_camera{1.0};  // OpenCV camera axes, metres, world Z up
};

struct CameraTrack {
  std::string name;
  ObserverCalibration calibration;
  double fps = 25;
  std::uint64_t frames = 0;     // of the take
  std::vector<CameraKey> keys;  // the frames that were tracked
};

// Rates are the mean of the observer's times. Throws previz::Error if the take has no calibration
// or no pose.
CameraTrack camera_track(const session::Session& session,
                         const std::vector<session::FrameRecord>& frames,
                         const ObserverCalibration& calibration);

// A .usda layer, Z up, in metres: one UsdGeomCamera with a matrix a tracked frame (USD interpolates
// between them). It looks along its -Z with Y up, and its matrices are of row vectors. Focal length
// and apertures are in tenths of a metre, as USD counts them; where the lens is not known, its
// focal length is that of a sensor 36 mm wide. The principal point is the aperture's offset;
// distortion USD cannot say, and is told in the camera's documentation.
std::string to_usda(const CameraTrack& track);

// Nuke's camera: a line a tracked frame, "frame tx ty tz rx ry rz vfov", metres and degrees. Nuke's
// world is Y up (X stays, its -Z is our Y); the rotation order is Nuke's default, ZXY: the matrix
// is Ry Rx Rz. vfov is the full vertical angle of the picture about the principal point's column.
std::string to_chan(const CameraTrack& track);

// Degrees (x, y, z) of that order for a rotation matrix; |x| <= 90.
glm::dvec3 zxy_degrees(const glm::dmat3& rotation);

struct ExportOptions {
  std::filesystem::path session;
  std::filesystem::path directory;  // made if need be
};
// `previzd export`: DIR/camera.usda, DIR/camera.chan, and the set's glTF files beside them. Poses
// are the take's; what they lack is told on `out`.
void export_take(const ExportOptions& options, std::ostream& out);

}  // namespace previz::exchange
