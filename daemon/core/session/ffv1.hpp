// Opens FFV1's encoder and decoder as every session's videos need them. Not for use outside
// the room.
#pragma once

#include <filesystem>

#include "daemon/core/session/av.hpp"
#include "daemon/core/session/session_toml.hpp"

namespace previz::session {

// FFV1 level 3, intra only, with slice checksums. Its settings, and with them the global header
// (extradata), follow from format and size alone. `file` names the video in errors: these throw
// previz::Error.
av::Codec open_ffv1_encoder(const StreamFormat& format, const std::filesystem::path& file);
av::Codec open_ffv1_decoder(const AVCodecParameters& parameters, const std::filesystem::path& file);
// Opens a decoder for packets whose own header is lost, with the header that a new encoder of this
// format makes.
av::Codec open_ffv1_decoder(const StreamFormat& format, const std::filesystem::path& file);
// No packet of such a video has more bytes. Raw: those of a frame. FFV1: libav's own bound for
// versions up to 3, 37 times 4 bytes a pixel and its padding (libavcodec/ffv1enc.c, encode_frame).
std::size_t most_packet_bytes(const StreamFormat& format);

}  // namespace previz::session
