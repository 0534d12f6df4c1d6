// The forms in which a session's videos hold their pictures.
#pragma once

namespace previz::session {

// Both are lossless, hold every PixelFormat, and have each frame by itself.
enum class VideoCodec {
  ffv1,  // FFV1 level 3 (RFC 9043) with slice checksums: the smaller files
  raw,   // samples as Frame::bytes has them: no work for the processor, 1.2 to 2.7 times the bytes
};

}  // namespace previz::session
