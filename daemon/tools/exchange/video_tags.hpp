// Reads what a video's file says of its pictures: colours, which side is up, the shape of a pixel.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/session/av.hpp"
#include "daemon/tools/exchange/orientation.hpp"

namespace previz::exchange {

// What FRAMES.json says of a video where its tags are wrong or lacking ("read_as"); libav's names.
struct ReadAs {
  std::optional<AVColorRange> range;
  std::optional<AVColorSpace> matrix;
  std::optional<AVColorTransferCharacteristic> transfer;
  std::optional<AVColorPrimaries> primaries;
  std::optional<Orientation> orientation;
  std::optional<AVRational> pixel_aspect;
  bool keeps_signal = false;  // transfer "as recorded": the response curve says what it means
};

// The colours that a container names; libav puts the decoder's in their place as it looks into the
// streams, and some decoders say "unspecified" there.
struct NamedColors {
  AVColorRange range = AVCOL_RANGE_UNSPECIFIED;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;
  AVColorTransferCharacteristic transfer = AVCOL_TRC_UNSPECIFIED;
  AVColorPrimaries primaries = AVCOL_PRI_UNSPECIFIED;
};
NamedColors named_colors(const AVCodecParameters& said);

struct VideoTags {
  bool full_range = false;
  AVColorSpace matrix = AVCOL_SPC_UNSPECIFIED;  // never left unspecified for Y'CbCr
  AVColorTransferCharacteristic transfer = AVCOL_TRC_UNSPECIFIED;
  AVColorPrimaries primaries = AVCOL_PRI_UNSPECIFIED;
  Orientation orientation;
  AVRational pixel_aspect = {1, 1};  // width to height
  // What was found and what was assumed, for people: "yuv420p10le, matrix bt709 (assumed), ...".
  std::string words;
};

// Reads the tags of a decoded frame, its stream and its file; colours that the frame does not name
// are the container's. Throws previz::Error, naming `file` and what makes it work, where they ask
// for what cannot be done.
VideoTags tags_of(const AVFrame& frame, AVStream& stream, AVFormatContext& context,
                  const NamedColors& container, const ReadAs& read_as,
                  const std::filesystem::path& file);

// Whether the format has no colours, or has them as red, green and blue.
bool is_gray(AVPixelFormat format);
bool is_rgb(AVPixelFormat format);
// Whether the format itself says "full range", as older ones do.
bool has_range_in_its_name(AVPixelFormat format);

}  // namespace previz::exchange
