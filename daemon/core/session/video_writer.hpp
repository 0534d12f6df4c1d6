// Writes lossless video in Matroska, such that every frame is in the file once write() returns. Not
// for use outside this room.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "daemon/core/session/session_toml.hpp"

namespace previz::session {

class VideoWriter {
 public:
  // The marks by which a written frame is found and checked again.
  struct Stamp {
    std::int64_t video_ms = 0;  // Matroska time; strictly increasing
    std::uint32_t crc32 = 0;    // of the packet
  };

  // Opens a file of the format's codec. Throws previz::Error naming the file.
  VideoWriter(const std::filesystem::path& file, const StreamFormat& format);
  ~VideoWriter();

  // The frame must have the format and size of the constructor.
  Stamp write(const Frame& frame);
  void sync() const;  // waits until all is on the medium
  void finish();      // writes index and duration; nothing may be written afterwards

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::session
