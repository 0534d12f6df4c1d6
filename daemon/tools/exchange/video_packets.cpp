#include "daemon/tools/exchange/video_packets.hpp"

#include <algorithm>
#include <utility>

namespace previz::exchange {
namespace {

// libav marks the packet before the one that lacks a part, or that one: a mark counts for two. At a
// joint, where counters of the stream begin again, the last two of a part are marked so.
constexpr std::size_t marked = 2;

}  // namespace

std::optional<VideoPackets::Unit> VideoPackets::next() {
  const std::size_t held = file_.iformat->flags & AVFMT_TS_DISCONT ? marked : 0;
  while (!ended_ && waiting_.size() <= held) ended_ = !read();
  if (waiting_.empty()) return std::nullopt;
  Unit unit = std::move(waiting_.front());
  waiting_.pop_front();
  return unit;
}

// Returns false after the last packet.
bool VideoPackets::read() {
  Unit unit{av::Packet(av::made(av_packet_alloc()))};
  AVPacket& packet = *unit.packet;
  if (const int result = av_read_frame(&file_, &packet); result < 0) {
    if (result != AVERROR_EOF) error_ = result;
    return false;
  }
  if (packet.stream_index != track_) return true;
  unit.begins_part = begins_part(packet);
  if (unit.begins_part) {
    for (Unit& before : waiting_) before.incomplete = false;
    incomplete_ = 0;
  } else if (packet.flags & AV_PKT_FLAG_CORRUPT) {
    incomplete_ = marked;
  }
  unit.incomplete = incomplete_ > 0;
  incomplete_ = std::max(0, incomplete_ - 1);
  waiting_.push_back(std::move(unit));
  return true;
}

// libav takes times that are far before the first ones for those of a clock that ran over.
bool VideoPackets::begins_part(const AVPacket& packet) {
  if (!(file_.iformat->flags & AVFMT_TS_DISCONT) || packet.dts == AV_NOPTS_VALUE) return false;
  const std::int64_t last = std::exchange(last_dts_, packet.dts);
  if (last == AV_NOPTS_VALUE) return false;
  const int bits = file_.streams[track_]->pts_wrap_bits;
  return packet.dts < last ||
         (bits > 1 && bits < 63 && packet.dts - last > std::int64_t{1} << (bits - 1));
}

}  // namespace previz::exchange
