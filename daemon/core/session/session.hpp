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

#include "daemon/core/session/records.hpp"
#include "daemon/core/session/video_codec.hpp"
#include "drivers/buttons.hpp"
#include "drivers/frame.hpp"

namespace previz::session {

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
  // What did not reach the disk while it was recorded, in words that are in `missing` as well: what
  // is there is whole all the same.
  std::vector<std::string> lost = {};
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
  // The directory must be empty or not exist yet. All is synced to the disk at least every
  // `sync_interval`. `codec` is
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
  void write(const MarkEvent& mark);     // likewise
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

// Brings a session that was cut off, and that nobody is writing, into order: notes in its
// session.toml that it was cut off, and returns how many frames of the observer it has; nothing if
// the session was closed, or had the note or another fault already. Does not read the videos.
// Throws previz::Error as open_session() does.
std::optional<std::uint64_t> salvage(const std::filesystem::path& directory);

// Changes the take that a finished session describes. Throws previz::Error naming the file.
void change_take(const std::filesystem::path& directory,
                 const std::function<void(TakeInfo&)>& change);

}  // namespace previz::session
