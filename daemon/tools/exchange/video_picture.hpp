// Makes a session's picture of a video's decoded frame.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/session/av.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/luma_chroma.hpp"
#include "daemon/tools/exchange/video_color.hpp"
#include "daemon/tools/exchange/video_tags.hpp"

namespace previz::exchange {

// Converts the frames of one video. What its tags say of the first frame holds for all.
class VideoPictures {
 public:
  // Throws previz::Error as tags_of() does.
  VideoPictures(const AVFrame& first, AVStream& stream, AVFormatContext& context,
                const NamedColors& container, const ReadAs& read_as, std::filesystem::path file);

  // Returns the frame upright, with square pixels, in the working space; as it is where that needs
  // no change. `name` is for errors.
  Picture picture(const AVFrame& frame, const std::string& name);
  // What was found and done, in plain words. It is complete after the last frame.
  std::vector<std::string> notes() const;
  // What was done to their shape, and how to have them as they were filmed.
  const std::vector<std::string>& shape() const { return shape_; }

 private:
  // The session's format for the picture, and libav's name for that format.
  struct Target {
    PixelFormat format;
    AVPixelFormat av_format;
  };
  Target target_of(const AVFrame& frame) const;
  bool stays_as_it_is(const AVFrame& frame) const;
  void copy(const AVFrame& frame, Picture& picture) const;
  void convert_gray(const AVFrame& frame, Picture& picture) const;
  void convert_color(const AVFrame& frame, AVPixelFormat format, Picture& picture);
  void repack(const AVFrame& frame, AVPixelFormat format, Picture& picture);

  std::filesystem::path file_;
  VideoTags tags_;
  ColorConversion colors_;
  std::optional<LumaChroma> luma_chroma_;
  std::vector<std::string> notes_, shape_;
  av::Scaler scaler_;
};

}  // namespace previz::exchange
