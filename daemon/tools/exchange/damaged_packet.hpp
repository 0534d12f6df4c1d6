// Finds damage in a video's packets that decoders take for pictures.
#pragma once

extern "C" {
#include <libavcodec/codec_id.h>
#include <libavcodec/packet.h>
}

namespace previz::exchange {

// Whether the packet has a hole of nought bytes, as a bad sector or a file that was never written
// to its end leaves it, where the codec allows none (H.264 and HEVC). Its bytes would decode,
// without a word, to a picture that is wrong.
bool has_hole(const AVPacket& packet, AVCodecID codec);

}  // namespace previz::exchange
