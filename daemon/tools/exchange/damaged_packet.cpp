#include "daemon/tools/exchange/damaged_packet.hpp"

#include <algorithm>
#include <span>

namespace previz::exchange {
namespace {

// Three noughts never follow each other within a unit (H.264 and H.265, 7.4.1.1). Around units
// there are more: in front of a start code any number, and in a unit's size up to three.
constexpr long longest_run = 8;

}  // namespace

bool has_hole(const AVPacket& packet, AVCodecID codec) {
  if (codec != AV_CODEC_ID_H264 && codec != AV_CODEC_ID_HEVC) return false;
  const std::span bytes(packet.data, static_cast<std::size_t>(packet.size));
  for (auto begin = bytes.begin(); begin != bytes.end();) {
    begin = std::find(begin, bytes.end(), 0);
    const auto end = std::find_if(begin, bytes.end(), [](auto byte) { return byte != 0; });
    const bool is_before_start_code = end == bytes.end() || *end == 1;
    if (end - begin > longest_run && !is_before_start_code) return true;
    begin = end;
  }
  return false;
}

}  // namespace previz::exchange
