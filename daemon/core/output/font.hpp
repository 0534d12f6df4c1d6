// Draws text in one font and size as coverage: HarfBuzz shapes it, FreeType draws the glyphs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace previz::output {

// Returns the font file that is installed with previzd.
std::filesystem::path default_font();

// How much of each pixel the text covers, from 0 (none) to 255 (all), row-major.
struct Coverage {
  int width = 0, height = 0;  // pixels
  std::vector<std::uint8_t> values;
};

class Font {
 public:
  // `size_px` is the height of the em. Throws previz::Error naming the file if it is no font.
  Font(const std::filesystem::path& file, int size_px);
  ~Font();
  Font(const Font&) = delete;
  Font& operator=(const Font&) = delete;

  // These are the same for every line of text, whatever its letters.
  int ascent() const;   // pixels above the baseline
  int descent() const;  // pixels below
  int cap_height() const;
  int width(const std::string& utf8) const;
  // Returns a picture of width() by ascent() + descent() pixels.
  Coverage draw(const std::string& utf8) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::output
