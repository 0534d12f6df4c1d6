#include "daemon/core/output/font.hpp"

#include <ft2build.h>
#include <hb-ft.h>
#include <hb.h>
#include FT_FREETYPE_H

#include <algorithm>
#include <span>
#include <string_view>

#include "drivers/error.hpp"

namespace previz::output {
namespace {

constexpr int units_a_pixel = 64;  // FreeType's 26.6 fixed point

int pixels(long units) {
  return static_cast<int>((units + units_a_pixel / 2) / units_a_pixel);
}

// A text as glyphs with the advance from each to the next.
class Shaped {
 public:
  Shaped(hb_font_t* font, const std::string& utf8) : buffer_(hb_buffer_create()) {
    hb_buffer_add_utf8(buffer_, utf8.data(), static_cast<int>(utf8.size()), 0, -1);
    hb_buffer_guess_segment_properties(buffer_);
    hb_shape(font, buffer_, nullptr, 0);
  }
  ~Shaped() { hb_buffer_destroy(buffer_); }
  Shaped(const Shaped&) = delete;
  Shaped& operator=(const Shaped&) = delete;

  std::span<const hb_glyph_info_t> glyphs() const {
    unsigned count = 0;
    const hb_glyph_info_t* first = hb_buffer_get_glyph_infos(buffer_, &count);
    return {first, count};
  }
  std::span<const hb_glyph_position_t> positions() const {
    unsigned count = 0;
    const hb_glyph_position_t* first = hb_buffer_get_glyph_positions(buffer_, &count);
    return {first, count};
  }
  int width() const {
    long advance = 0;
    for (const hb_glyph_position_t& position : positions()) advance += position.x_advance;
    return pixels(advance);
  }

 private:
  hb_buffer_t* buffer_;
};

// Adds a glyph, which may overlap others; its parts outside the picture are cut off.
void add(const FT_Bitmap& glyph, int left, int top, Coverage& to) {
  for (int row = 0; row < static_cast<int>(glyph.rows); ++row)
    for (int column = 0; column < static_cast<int>(glyph.width); ++column) {
      const int x = left + column;
      const int y = top + row;
      if (x < 0 || y < 0 || x >= to.width || y >= to.height) continue;
      std::uint8_t& pixel = to.values[static_cast<std::size_t>(y * to.width + x)];
      pixel = std::max(pixel, glyph.buffer[row * glyph.pitch + column]);
    }
}

}  // namespace

std::filesystem::path default_font() {
  return PREVIZ_FONT;
}

struct Font::Impl {
  FT_Library library = nullptr;
  FT_Face face = nullptr;
  hb_font_t* shaper = nullptr;

  ~Impl() {
    if (shaper) hb_font_destroy(shaper);
    if (face) FT_Done_Face(face);
    if (library) FT_Done_FreeType(library);
  }
};

Font::Font(const std::filesystem::path& file, int size_px) : impl_(std::make_unique<Impl>()) {
  const auto size = static_cast<FT_UInt>(std::max(size_px, 1));
  if (FT_Init_FreeType(&impl_->library) != 0) throw Error("FreeType cannot be initialised");
  if (FT_New_Face(impl_->library, file.c_str(), 0, &impl_->face) != 0 ||
      FT_Set_Pixel_Sizes(impl_->face, 0, size) != 0)
    throw Error(file.string() + ": is not a readable font; the display's text needs it");
  impl_->shaper = hb_ft_font_create_referenced(impl_->face);
  hb_ft_font_set_load_flags(impl_->shaper, FT_LOAD_TARGET_LIGHT);
}

Font::~Font() = default;

int Font::ascent() const {
  return pixels(impl_->face->size->metrics.ascender);
}

int Font::descent() const {
  return -pixels(impl_->face->size->metrics.descender);
}

int Font::cap_height() const {
  if (FT_Load_Char(impl_->face, 'H', FT_LOAD_TARGET_LIGHT) != 0) return ascent();
  return pixels(impl_->face->glyph->metrics.height);
}

int Font::width(const std::string& utf8) const {
  return Shaped(impl_->shaper, utf8).width();
}

Coverage Font::draw(const std::string& utf8) const {
  const Shaped shaped(impl_->shaper, utf8);
  Coverage coverage{shaped.width(), ascent() + descent(), {}};
  coverage.values.resize(static_cast<std::size_t>(coverage.width * coverage.height));
  long pen = 0;
  const auto positions = shaped.positions();
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (FT_Load_Glyph(impl_->face, shaped.glyphs()[i].codepoint,
                      FT_LOAD_TARGET_LIGHT | FT_LOAD_RENDER) == 0) {
      const FT_GlyphSlot glyph = impl_->face->glyph;
      add(glyph->bitmap, pixels(pen + positions[i].x_offset) + glyph->bitmap_left,
          ascent() - pixels(positions[i].y_offset) - glyph->bitmap_top, coverage);
    }
    pen += positions[i].x_advance;
  }
  return coverage;
}

}  // namespace previz::output
