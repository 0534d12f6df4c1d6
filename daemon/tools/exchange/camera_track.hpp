// Exports the camera of a take for other tools, as USD and as Nuke's .chan.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <iosfwd>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/core/session/nominal_rate.hpp"
#include "daemon/core/session/session.hpp"
#include "drivers/calibration.hpp"

namespace previz::exchange {

struct CameraKey {
  std::uint64_t frame = 0;            // place in the take, from 0
  glm::dmat4 world_from_camera{1.0};  // OpenCV camera axes, metres, world Z up
};

struct CameraTrack {
  std::string name;
  ObserverCalibration calibration;
  session::NominalRate rate;
  std::optional<session::Timecode> timecode;  // of frame 0
  std::uint64_t frames = 0;                   // number of frames in the take
  std::vector<CameraKey> keys;                // the frames that were tracked
};

// Makes the camera track of a take; its rate is the nominal one of the observer's times. Throws
// previz::Error if the take has no calibration or no pose.
CameraTrack camera_track(const session::Session& session,
                         const std::vector<session::FrameRecord>& frames,
                         const ObserverCalibration& calibration);

// Returns a .usda layer, Z up, in metres: a Xform "camera" with a place and a turn for each tracked
// frame (USD interpolates between them), and in it the UsdGeomCamera "lens", which looks along its
// -Z with Y up. (three.js 0.187's loader holds a camera still whose own transform has samples.)
// Focal length and apertures are in tenths of a metre, as USD counts them; if the lens is not
// known, the focal length assumes a sensor 36 mm wide. The principal point becomes the aperture's
// offset. USD cannot express distortion, so the camera's documentation states it.
std::string to_usda(const CameraTrack& track);

// Returns Nuke's camera: a line for each tracked frame, "frame tx ty tz rx ry rz vfov", metres and
// degrees. Nuke's world is Y up (X stays, its -Z is our Y); the rotation order is Nuke's default,
// ZXY: the matrix is Ry Rx Rz. vfov is the vertical angle of view of the whole picture as Nuke's
// Camera counts it, 2 atan(height / (2 fy)): what the principal point is off is its window
// translate.
std::string to_chan(const CameraTrack& track);

// Returns the angles (x, y, z) in degrees of a rotation matrix in the order ZXY; |x| <= 90.
glm::dvec3 zxy_degrees(const glm::dmat3& rotation);

struct ExportOptions {
  std::filesystem::path session;
  std::filesystem::path directory;                     // made if need be
  std::optional<std::filesystem::path> set_file = {};  // instead of the session's own
  bool any_paths = false;     // also files outside of the session that its set names
  std::stop_token stop = {};  // ends the search for poses, with previz::Error
};
// Writes DIR/camera.usda, DIR/camera.chan and the glTF file of each object, moved to where the set
// and the take have it, as `previz export` does; of two files of one name, the second becomes
// NAME_2. Poses are the take's, and those that it has not are found by the set's tags, as rendering
// does; gaps in them, and objects that move during the take, are reported on `out`.
void export_take(const ExportOptions& options, std::ostream& out);

}  // namespace previz::exchange
