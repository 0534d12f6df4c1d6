// Reads and writes sessions: what the devices of a take delivered, on disk. The top of session.cpp
// describes the directory layout; the .jsonl files are the truth for time, the .mkv for samples.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "drivers/buttons.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/session/timecode.hpp"
#include "drivers/session/video_codec.hpp"

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

// Returns what was lost: "12 frames of the cameras", "3 pictures that were shown". Empty: nothing.
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
  std::optional<double> animation_s;  // time in the animations; absent: nothing is animated

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

// Reads one stream (observer or light) in order or by index. Frames come as they were recorded,
// sample for sample. Not thread-safe.
class StreamReader {
 public:
  virtual ~StreamReader() = default;
  virtual const std::vector<FrameRecord>& records() const = 0;  // whole frames only
  virtual PixelFormat format() const = 0;
  virtual BayerPattern bayer() const = 0;
  virtual int width() const = 0;   // pixels
  virtual int height() const = 0;  // pixels
  // Reads frame `index`, seeking if it must. Throws previz::Error naming file and frame if
  // unreadable.
  virtual FramePtr read(std::size_t index) = 0;
};

// An opened session. Opening a truncated or damaged session succeeds up to its last whole frame;
// `missing` says in plain words what is not there.
struct Session {
  std::filesystem::path directory;
  SessionInfo info;
  std::vector<TrackRecord> track;  // empty where nothing was tracked
  std::vector<std::string> missing;
};

// Throws previz::Error naming the file (and line) if session.toml cannot be understood. Checks the
// assets' content hashes, and with them reads the assets once. That, as the reading of
// open_stream(), may take minutes; a stop ends it with previz::Error.
Session open_session(const std::filesystem::path& directory, const std::stop_token& stop = {});
// Opens the stream `source`: "observer", "light" or "composite" (what was shown). Returns null if
// the session has no such stream. What is missing of the stream is appended to session.missing.
// Reads the video once from end to end, so that a damaged picture is known here (packet checksums)
// and never shown. Where pictures are missing, it looks for each by its checksum, also in a file
// whose head is torn.
std::unique_ptr<StreamReader> open_stream(Session& session, const std::string& source,
                                          const std::stop_token& stop = {});

// Writes a session directory; every call leaves a readable session behind. Lossless
// video in Matroska; streams open at their first frame. Throws previz::Error naming the file on
// failure. A frame has reached the kernel when write() returns: a process killed at any time loses
// at most the frame it was writing. About once a second write() also waits until all is on the
// disk, the files' names included: a power cut loses about the last second. Once a call has failed
// because of the disk, nothing can be added, and the session is never marked as closed: what the
// disk has is not known. Call it from a thread that may wait. Not thread-safe.
class SessionWriter {
 public:
  // The directory must not exist or be empty. All is on the disk at least this often. `codec` is
  // that of the cameras' pictures; the composite's is always FFV1.
  SessionWriter(const std::filesystem::path& directory, const SessionInfo& info,
                std::chrono::nanoseconds sync_interval = std::chrono::seconds(1),
                VideoCodec codec = VideoCodec::ffv1);
  ~SessionWriter();
  SessionWriter(const SessionWriter&) = delete;
  SessionWriter& operator=(const SessionWriter&) = delete;

  // Goes to the stream that frame.source names. Frames of a stream have one format, Bayer pattern
  // and size, at least 8x8 pixels.
  void write(const Frame& frame);
  void write(const TrackRecord& record);
  void write(const ButtonEvent& event);  // writes to events.jsonl
  // Writes anything else that happened, in words, to events.jsonl.
  void write_event(std::int64_t timestamp_ns, const std::string& what);
  void set_take(const TakeInfo& take);          // replaces session.toml
  void set_timecode(const Timecode& timecode);  // likewise
  // Copies a file into assets/ under its content hash and maps `as_written` to it.
  void add_asset(const std::string& as_written, const std::filesystem::path& file);
  // Names the assets, which must be in the directory and on the disk, and those that are not there.
  // In a session that has failed they are written when it is abandoned.
  void set_assets(std::map<std::string, std::string> assets, std::vector<MissingAsset> missing);
  // Says what is not in the session; it is written when the session ends.
  void set_lost(const Losses& lost);
  // Returns whether the disk has done all that was asked of it. Where it has, an exception of
  // write() is about what was to be written, and the next can be written.
  bool is_sound() const;
  // Flushes and finishes the files. The destructor does it too, without throwing.
  void close();
  // Ends the session as it is, not closed, with this reason in session.toml, where the disk lets
  // it. Does nothing if the session has ended. Never throws previz::Error.
  void abandon(const std::string& fault);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Returns whether a SessionWriter, of any process on this machine, is writing the session now, as
// far as the file system knows locks.
bool is_being_written(const std::filesystem::path& directory);

// Brings a session that was cut off, and that nobody is writing, into order: writes into its
// session.toml that, unless it is there already, and returns how many frames of the observer it
// has; nothing if there was nothing to do. Does not read the videos. Throws previz::Error as
// open_session() does.
std::optional<std::uint64_t> salvage(const std::filesystem::path& directory);

// Changes the take that a finished session describes. Throws previz::Error naming the file.
void change_take(const std::filesystem::path& directory,
                 const std::function<void(TakeInfo&)>& change);

}  // namespace previz::session
