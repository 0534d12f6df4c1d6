// What a session holds, as data: session.toml and the lines of its .jsonl files.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/session/timecode.hpp"
#include "drivers/calibration.hpp"

namespace previz::session {

// What session.toml has as format_version. A session has the first one that can say what is in it,
// so that an earlier previzd reads what it can and refuses the rest. 1: all videos are FFV1; 2: a
// video may say its codec.
inline constexpr int first_format_version = 1, format_version = 2;

// Identifies the take of a session, as the clapperboard does.
struct TakeInfo {
  int number = 0;
  std::string slate;     // scene and shot
  std::string timecode;  // of the first observer frame, time of day: "14:03:27:12"
  double timecode_fps = 25;
  std::string notes;
  bool good = false;  // the crew's choice

  friend bool operator==(const TakeInfo&, const TakeInfo&) = default;
};

// What was offered for recording and did not reach the disk.
struct Losses {
  std::uint64_t frames = 0;   // of either camera
  std::uint64_t shown = 0;    // pictures that were shown
  std::uint64_t records = 0;  // lines of tracking, buttons and events

  friend bool operator==(const Losses&, const Losses&) = default;
};

// Returns what was lost: "12 camera frames", "3 composite frames". Empty: nothing.
std::vector<std::string> words_of(const Losses& lost);

// A file that the set needs and the session does not have.
struct MissingAsset {
  std::string as_written;      // how the set names it
  std::filesystem::path file;  // where it was when the session was recorded
  std::string sha256;          // of its content then; empty: that is not known
  std::string why;

  friend bool operator==(const MissingAsset&, const MissingAsset&) = default;
};

// session.toml. `set_text` is the set file verbatim; `set_name` the file name to use in errors.
struct SessionInfo {
  std::string name;
  std::string clock = "monotonic";  // the clock of timestamp_ns
  std::string set_name = "set.toml";
  std::string set_text;
  std::optional<ObserverCalibration> observer;
  std::optional<LightCameraCalibration> light;
  // Paths as the set file writes them -> paths below the session ("assets/<sha256>.glb").
  std::map<std::string, std::string> assets;
  std::vector<MissingAsset> missing_assets;
  std::optional<TakeInfo> take;      // recorded on a rig
  std::optional<Timecode> timecode;  // of an imported clip that has one
};

// Returns the timecode of a take or of an imported clip; nothing if it has none.
std::optional<Timecode> timecode_of(const SessionInfo& info);

// A point of a real thing that somebody has marked in a picture of the observer; or that mark
// withdrawn.
struct MarkEvent {
  std::int64_t timestamp_ns = 0;  // of the picture
  std::string point;
  glm::dvec2 px{0};  // in it; (0, 0) is the centre of the top left pixel
  bool is_withdrawn = false;

  friend bool operator==(const MarkEvent&, const MarkEvent&) = default;
};

// A lamp of the set that was moved or relit.
struct LightState {
  glm::dvec3 position{0}, direction{0, 0, -1}, up{0, 1, 0};
  double gain_mixed = 1;
  glm::dvec3 tint{1};  // times its emission, in the mixed world

  friend bool operator==(const LightState&, const LightState&) = default;
};
// Everything that was moved, relit or given other materials, by name; what is as the set file has
// it is left out.
struct SceneState {
  // Each is world_from_file; nothing: its carrier was not found yet, and the object is nowhere.
  std::map<std::string, std::optional<glm::dmat4>> objects;
  std::map<std::string, std::optional<LightState>> lights;
  // The variant of its materials that an object is shown in; "" is its file as it is without one.
  std::map<std::string, std::string> variants = {};
  std::optional<double> animation_s;    // time in the animations; absent: nothing is animated
  std::optional<bool> hides_tags = {};  // absent: as the set file has it
  // How the environment file was turned, counter-clockwise from above; absent: as the set has it.
  std::optional<double> environment_turn_rad = {};

  friend bool operator==(const SceneState&, const SceneState&) = default;
};

// The place of a carrier, which is moved by hand, as found by its tags.
struct CarrierState {
  glm::dmat4 world_from_carrier{1.0};  // the last one known
  // Row-major 6x6: rotation (rad) then translation (m), in the carrier's frame.
  std::array<double, 36> covariance{};
  std::vector<int> tags;  // ids that found it in this frame; none: it was not found

  friend bool operator==(const CarrierState&, const CarrierState&) = default;
};
using Carriers = std::map<std::string, CarrierState>;  // those that were found at least once

// A light source around the set, as it lit the frame.
struct CapturedSource {
  int id = 0;                     // the same from frame to frame
  glm::dvec3 direction{0, 0, 1};  // unit, world, from the light camera towards it
  double solid_angle_sr = 0;
  glm::dvec3 flux{0};  // integral of radiance over solid angle, linear Rec. 709

  friend bool operator==(const CapturedSource&, const CapturedSource&) = default;
};
// The light around the set, as it lit the frame: its sources, and the rest without its shapes.
struct CapturedLight {
  std::vector<CapturedSource> sources;
  int ambient_size = 0;            // equal-area octahedral map, texels a side, at most 64
  std::vector<glm::vec3> ambient;  // radiance, row-major

  friend bool operator==(const CapturedLight&, const CapturedLight&) = default;
};

// A line of track.jsonl.
struct TrackRecord {
  std::uint64_t frame = 0;  // index of the observer frame
  std::int64_t timestamp_ns = 0;
  bool tracked = false;               // false: lost; the pose is then not valid
  glm::dmat4 world_from_camera{1.0};  // OpenCV camera axes, metres
  // Row-major 6x6: rotation (rad) then translation (m), in the camera frame.
  std::array<double, 36> covariance{};
  std::vector<int> tags;  // ids of the tags used
  SceneState scene;       // when the frame was shown; empty: as in the set
  Carriers carriers;
  std::optional<CapturedLight> captured_light;  // absent: none was known, or an older session
};

// A frame of a stream as recorded; `frame` is its position in the .mkv, from 0.
struct FrameRecord {
  std::uint64_t frame = 0;
  std::uint64_t sequence = 0;
  std::int64_t timestamp_ns = 0;
  std::int64_t arrival_ns = 0;
  double exposure_s = 0, gain = 1, exposure = 1;
};

}  // namespace previz::session
