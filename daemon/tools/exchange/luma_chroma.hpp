// Makes red, green and blue of a video's luma and chroma.
#pragma once

extern "C" {
#include <libavutil/pixfmt.h>
}

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "daemon/core/session/av.hpp"

namespace previz::exchange {

// How much of luma is red and blue; green is the rest.
struct LumaShares {
  double red, blue;
};
// ITU-T H.273 table 4. Nothing for matrices that are not of this form (YCgCo, constant luminance).
std::optional<LumaShares> luma_shares(AVColorSpace matrix);

class LumaChroma {
 public:
  // `matrix` has luma_shares(). `full_range`: black to white are all codes, not 16 to 235 and 16 to
  // 240 of 8 bits.
  LumaChroma(AVColorSpace matrix, bool full_range);

  // Writes R'G'B', 0 to 65535, clipped, of a frame of Y'CbCr with 8 to 16 bits; chroma of fewer
  // samples is interpolated. Throws previz::Error with `name` for other formats.
  void convert(const AVFrame& frame, std::span<std::uint16_t> rgb, const std::string& name);

 private:
  const AVFrame& with_whole_chroma(const AVFrame& frame, const std::string& name);

  LumaShares shares_;
  bool full_range_;
  av::Scaler scaler_;
  av::Picture whole_;
};

}  // namespace previz::exchange
