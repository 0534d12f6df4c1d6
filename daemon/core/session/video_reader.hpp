// Reads packets and pictures of a stream's Matroska file, as far as it is whole. Not for use
// outside this room.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <vector>

#include "daemon/core/session/clusters.hpp"
#include "daemon/core/session/session_toml.hpp"

namespace previz::session {

class VideoReader {
 public:
  struct PacketInfo {
    std::int64_t video_ms = 0;  // Matroska time
    std::uint32_t crc32 = 0;    // of the packet as it is in the file now
  };

  // Throws previz::Error naming the file if it holds no track of the format's
  // codec that can be read.
  VideoReader(const std::filesystem::path& file, const StreamFormat& format);
  // Reads these packets where they lie, whatever the rest of the file is, with a video header made
  // anew from the format. Throws previz::Error naming the file.
  VideoReader(const std::filesystem::path& file, const StreamFormat& format,
              const std::vector<PacketPlace>& packets);
  ~VideoReader();

  // Returns every packet that can be found, in file order or in order of time. Reads the file once
  // from end to end; a stop ends that with previz::Error.
  std::vector<PacketInfo> scan(const std::stop_token& stop = {});
  // Returns Frame::bytes of the packet; packets read in order need no seeking. Throws previz::Error
  // naming the file and the time if the packet, or a whole picture in it, is not there.
  std::vector<std::uint8_t> read(const PacketInfo& packet);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::session
