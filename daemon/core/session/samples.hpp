// Converts between a frame's packed samples and libav's pictures. Not for use outside this room.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/core/session/av.hpp"
#include "drivers/frame.hpp"

namespace previz::session {

// Returns the format that FFV1 is given; its bit stream for rgb8 and rgb16 is planar G, B, R
// through a reversible transform, whichever way the samples lie in memory.
AVPixelFormat encoder_format(PixelFormat format);
// Returns the format whose samples a decoded picture holds; none if no session holds such pictures.
std::optional<PixelFormat> session_format(AVPixelFormat format);

// Copies `bytes`, laid out as Frame::bytes, into `picture`, which must be allocated with
// encoder_format(format) and its size.
void pack(std::span<const std::uint8_t> bytes, PixelFormat format, AVFrame& picture);
// Returns Frame::bytes of a decoded picture; its format must be one that session_format() knows.
std::vector<std::uint8_t> unpack(const AVFrame& picture);

}  // namespace previz::session
