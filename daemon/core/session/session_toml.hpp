// Writes and parses session.toml, in which a session describes itself. Not for use outside this
// room.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "daemon/core/session/records.hpp"
#include "daemon/core/session/video_codec.hpp"
#include "drivers/frame.hpp"

namespace previz::session {

// The format of a stream's pictures, which session.toml repeats so that a damaged video header is
// noticed.
struct StreamFormat {
  PixelFormat format = PixelFormat::rgb8;
  int width = 0, height = 0;            // pixels
  std::optional<std::uint64_t> frames;  // known once the session was closed
  BayerPattern bayer = BayerPattern::none;
  VideoCodec codec = VideoCodec::ffv1;  // what older sessions, which do not say it, have
};

struct SessionFile {
  SessionInfo info;
  std::map<std::string, StreamFormat> streams;  // by source
  bool closed = false;                          // the recording came to an orderly end
  std::string fault;                            // why it did not, where that is known
  Losses lost;
};

// Throws previz::Error if a name or path is not UTF-8. The set's text may be any bytes.
std::string to_toml(const SessionFile& file);
// `path` names the text in errors. Throws previz::Error naming line and key.
SessionFile parse_session_toml(const std::string& text, const std::filesystem::path& path);
// Reads and parses the file of a session, which must be a file itself (open_plain_file()).
SessionFile read_session_toml(const std::filesystem::path& file);

}  // namespace previz::session
