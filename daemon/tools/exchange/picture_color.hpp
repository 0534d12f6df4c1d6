// Reads what a still says its colours mean, and brings them to the working space.
#pragma once

#include <compare>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>

#include "daemon/tools/exchange/video_color.hpp"
#include "daemon/tools/exchange/video_tags.hpp"

namespace Exiv2 {
class Image;
}

namespace previz::exchange {

// The tag that holds for a still's colours, with its own bytes. Of several it is the first of
// these.
struct ColorTag {
  enum class Kind {
    cicp,   // PNG's chunk of four numbers of ITU-T H.273
    icc,    // a profile
    srgb,   // PNG's chunk, or EXIF's colour space
    gamma,  // PNG's chunk gAMA, followed by cHRM if that is there
    white,  // TIFF's chromaticities: 8 numbers as text
    adobe,  // EXIF's colour space of DCF's option file: Adobe RGB (1998)
    none
  };
  Kind kind = Kind::none;
  std::string bytes{};

  bool has_primaries() const { return kind != Kind::gamma || bytes.size() > 4; }
  friend auto operator<=>(const ColorTag&, const ColorTag&) = default;
};

// `content` is the whole file, `image` what Exiv2 has read of it.
ColorTag color_tag_of(std::string_view content, Exiv2::Image& image);

// Converts stills with one tag.
class StillColors {
 public:
  // Throws previz::Error, naming `file`, the tag and what to do, for what cannot be converted.
  StillColors(const ColorTag& tag, const std::filesystem::path& file);
  // By what FRAMES.json says instead.
  explicit StillColors(const ReadAs& read_as);
  ~StillColors();
  StillColors(StillColors&&) noexcept;

  bool changes_anything() const;
  // Converts grey, or red, green and blue, of 8 or 16 bits, to 16 bits. Throws as the constructor.
  void convert(cv::Mat& picture, const std::filesystem::path& file);
  // "its ICC profile "Adobe RGB (1998)"", for people.
  const std::string& words() const { return words_; }
  // Share of the samples so far that lay outside of Rec. 709; 0 where a profile has tables.
  double clipped_share() const;

 private:
  struct Tables;
  void read_cicp(const std::string& bytes, const std::filesystem::path& file);
  void read_gamma(const std::string& bytes, const std::filesystem::path& file);
  void read_white(const std::string& text, const std::filesystem::path& file);
  void read_profile(const std::string& bytes, const std::filesystem::path& file);

  std::string words_;
  std::optional<ColorConversion> conversion_;
  std::unique_ptr<Tables> tables_;
  bool is_of_grey_ = false;
};

}  // namespace previz::exchange
