// Text of one font and size as coverage: HarfBuzz shapes it, FreeType draws the glyphs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace previz::output {

// The one that is installed with previzd.
std::filesystem::path default_font();

// 0 none .. 255 all of a pixel.
struct Coverage {
  int width = 0, height = 0;  // pixels
  std::vector<std::uint8_t> values;
};

class Font {
 public:
  // `size_px` is the em. Throws previz::Error naming the file if it is no font.
  Font(const std::filesystem::path& file, int size_px);
  ~Font();
  Font(const Font&) = delete;
  Font& operator=(const Font&) = delete;

  // Of every line, whatever its letters.
  int ascent() const;   // pixels above the baseline
  int descent() const;  // pixels below
  int cap_height() const;
  int width(const std::string& utf8) const;
  // width() by ascent() + descent().
  Coverage draw(const std::string& utf8) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::output
