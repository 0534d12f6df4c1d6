// A session on disk:
//
//   SESSION/
//     session.toml    format version, name, clock; whether it was closed, by what fault it ended
//                     and what did not reach the disk; per stream its pixel format, size and, once
//                     the session is closed, its number of frames; calibrations; the asset map, and
//                     which assets are not here, what they were and why; the set file verbatim.
//                     Replaced as a whole, never edited in place.
//                     format_version is 1, or 2 if the codec of a stream is "raw".
//     observer.mkv    FFV1 level 3, every frame a key frame, slice checksums, a Matroska cluster a
//                     frame: RGB (8 or 16 bit), gray (8 or 16 bit) or 4:2:2 Y'CbCr. Of codec
//                     "raw" the samples themselves, rows without padding, planes one after the
//                     other; its checksum is that of the line. Matroska times are milliseconds from
//                     the first frame, strictly increasing.
//     observer.jsonl  a line a frame: frame, sequence, timestamp_ns, arrival_ns, exposure_s, gain,
//                     exposure; video_ms and crc32 name the packet of observer.mkv that holds its
//                     picture, so that the two files can lose parts and still be joined rightly.
//     light.mkv, light.jsonl   likewise; a bracket is consecutive frames
//     track.jsonl     a line a frame: frame, timestamp_ns, tracked, tags; if tracked also
//                     world_from_camera (16 numbers, row-major) and covariance (36 numbers);
//                     objects, lights and variants of objects that are not as the set has them
//     events.jsonl    a line an event, in order of arrival: timestamp_ns and what happened; of a
//                     button: button (its name), pressed; of a mark: mark (the point's name), px
//                     in the observer's picture of that time, or withdrawn; of all else: event, in
//                     words
//     assets/         files of the set, named by the SHA-256 of their content
#include "daemon/core/session/session.hpp"

#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/missing.hpp"
#include "daemon/core/session/session_toml.hpp"
#include "daemon/core/session/summary.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

// A session from elsewhere may name any file; what is not in its folder is not its own.
void forget_foreign_assets(Session& session) {
  std::erase_if(session.info.assets, [&](const auto& asset) {
    const bool is_own = lies_within(session.directory, session.directory / asset.second);
    if (!is_own)
      session.missing.push_back(asset.second + " (" + asset.first +
                                "): lies outside the session, and is not read");
    return !is_own;
  });
}

void check_assets(Session& session, const std::stop_token& stop) {
  forget_foreign_assets(session);
  for (const auto& [as_written, file, sha256, why] : session.info.missing_assets)
    session.missing.push_back(as_written + ": missing from the take, because " + why +
                              "; original: " + file.string() +
                              (sha256.empty() ? "" : " with the SHA-256 " + sha256));
  for (const auto& [as_written, path] : session.info.assets) {
    const std::filesystem::path file = session.directory / path;
    const std::string named = path + " (" + as_written + ")";
    if (!std::filesystem::is_regular_file(file))
      session.missing.push_back(named + ": the file is missing");
    else if (sha256_of(file, stop) != file.stem())
      session.missing.push_back(named + ": the file was changed since it was recorded");
  }
}

void read_end(const SessionFile& file, Session& session) {
  const auto miss = [&](const std::string& what) {
    session.missing.push_back("session.toml: " + what);
  };
  if (file.closed && !file.fault.empty())
    miss(file.fault);  // repair_session() writes both
  else if (!file.fault.empty())
    miss("the recording ended with a fault (" + file.fault +
         "); all after the last complete frame is lost");
  else if (!file.closed)
    miss(
        "the recording was not closed (power cut, crash, or still recording); all "
        "after the last complete frame, about a second at most, is lost");
  for (const std::string& what : words_of(file.lost)) {
    miss(what + " did not reach the disk in time");
    session.lost.push_back(session.missing.back());
  }
}

void read_track(Session& session) {
  Lines<TrackRecord> lines = read_track_lines(session.directory / "track.jsonl");
  session.track = std::move(lines.records);
  if (!lines.bad_lines.empty())
    session.missing.push_back("track.jsonl: " + list_of("line", lines.bad_lines) +
                              " unreadable, skipped");
}

}  // namespace

Session open_session(const std::filesystem::path& directory, const std::stop_token& stop) {
  const std::filesystem::path toml = directory / "session.toml";
  if (!std::filesystem::exists(directory))
    throw Error(directory.string() +
                ": not found; `previz takes list FOLDER` shows the existing takes");
  if (!std::filesystem::exists(std::filesystem::symlink_status(toml)))
    throw Error(directory.string() +
                (std::filesystem::is_directory(directory)
                     ? ": is not a session; it holds no session.toml"
                     : ": is a file and not a session, which is a folder") +
                "; previz import makes one of pictures or a video");
  const SessionFile file = read_session_toml(toml);
  Session session{directory, file.info, {}, {}};
  read_end(file, session);
  for (const std::string& stranger : strangers_in(directory)) session.missing.push_back(stranger);
  check_assets(session, stop);
  read_track(session);
  return session;
}

}  // namespace previz::session
