// FFV1 in Matroska, written so that every frame is in the file once write() returns. Not for use
// outside drivers/.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "drivers/session/session_toml.hpp"

namespace previz::session {

class VideoWriter {
 public:
  // How to find and check a written frame again.
  struct Stamp {
    std::int64_t video_ms = 0;  // Matroska time; strictly increasing
    std::uint32_t crc32 = 0;    // of the packet
  };

  // FFV1 level 3, intra only, with slice checksums. Throws previz::Error naming the file.
  VideoWriter(const std::filesystem::path& file, const StreamFormat& format);
  ~VideoWriter();

  // The frame must have the format and size of the constructor.
  Stamp write(const Frame& frame);
  void sync() const;  // to the medium
  void finish();      // index and duration; nothing may be written afterwards

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::session
