// Reads the packets of a video's track, and knows where recordings are joined in one file.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "daemon/core/session/av.hpp"

namespace previz::exchange {

class VideoPackets {
 public:
  struct Unit {
    av::Packet packet;
    bool incomplete = false;   // a part of it may be missing in the file
    bool begins_part = false;  // a recording that was appended: times begin again here
  };

  // The file lives longer, and nobody else reads from it.
  VideoPackets(AVFormatContext& file, int track) : file_(file), track_(track) {}

  // Returns the next packet of the track; nothing after the last, and where error() is not 0.
  std::optional<Unit> next();
  // Returns libav's word for why the file cannot be read to its end; 0 if it can.
  int error() const { return error_; }

 private:
  bool read();
  bool begins_part(const AVPacket& packet);

  AVFormatContext& file_;
  int track_;
  std::deque<Unit> waiting_;
  std::int64_t last_dts_ = AV_NOPTS_VALUE;
  int incomplete_ = 0;  // so many packets, from the next on, may lack a part
  bool ended_ = false;
  int error_ = 0;
};

}  // namespace previz::exchange
