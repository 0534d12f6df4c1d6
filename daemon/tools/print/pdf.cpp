#include "daemon/tools/print/pdf.hpp"

#include <cairo-pdf.h>
#include <cairo.h>

#include <array>
#include <memory>

#include "drivers/error.hpp"

namespace previz::print {
namespace {

constexpr double points_per_mm = 72 / 25.4;
constexpr double hair_mm = 0.1, mark_mm = 3, mark_gap_mm = 0.5;
constexpr double letter_share = 1.35;  // of a letter's height: cairo's size is that of the line

struct Closer {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* cairo) const { cairo_destroy(cairo); }
};

cairo_status_t append_bytes(void* to, const unsigned char* bytes, unsigned int count) {
  static_cast<std::string*>(to)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
}

void insist(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS)
    throw Error(std::string("the PDF cannot be written: ") + cairo_status_to_string(status));
}

// A pen on one sheet, in millimetres.
class Pen {
 public:
  explicit Pen(cairo_t* cairo) : cairo_(cairo) {
    cairo_set_source_rgb(cairo_, 0, 0, 0);
    cairo_set_line_width(cairo_, hair_mm);
    cairo_select_font_face(cairo_, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           CAIRO_FONT_WEIGHT_NORMAL);
  }

  void line(const Line& line) {
    constexpr double dashes[] = {1.5, 1.5};
    cairo_set_dash(cairo_, dashes, line.fold ? 2 : 0, 0);
    cairo_set_source_rgb(cairo_, 0.5, 0.5, 0.5);
    cairo_move_to(cairo_, line.x0, line.y0);
    cairo_line_to(cairo_, line.x1, line.y1);
    cairo_stroke(cairo_);
    cairo_set_source_rgb(cairo_, 0, 0, 0);
    cairo_set_dash(cairo_, nullptr, 0, 0);
  }
  void words(const Words& words) {
    cairo_set_font_size(cairo_, letter_share * words.height);
    cairo_move_to(cairo_, words.x, words.y);
    cairo_show_text(cairo_, words.text.c_str());
  }
  // Fills all at once, so that no seam shows between neighbours.
  void black(const std::vector<Rectangle>& all) {
    for (const Rectangle& r : all) cairo_rectangle(cairo_, r.x, r.y, r.width, r.height);
    cairo_fill(cairo_);
  }
  void drawing(const Drawing& drawing, const Placed& placed) {
    cairo_save(cairo_);
    const Rectangle& w = placed.window;
    cairo_rectangle(cairo_, w.x, w.y, w.width, w.height);
    cairo_clip(cairo_);
    cairo_translate(cairo_, placed.x, placed.y);
    black(drawing.black);
    for (const Line& each : drawing.lines) line(each);
    for (const Words& each : drawing.words) words(each);
    cairo_restore(cairo_);
  }

  void crop_marks(const Rectangle& window) {
    for (const double x : {window.x, window.x + window.width})
      for (const double y : {window.y, window.y + window.height}) {
        const double dx = x == window.x ? -1 : 1, dy = y == window.y ? -1 : 1;
        line({x + dx * mark_gap_mm, y, x + dx * (mark_gap_mm + mark_mm), y});
        line({x, y + dy * mark_gap_mm, x, y + dy * (mark_gap_mm + mark_mm)});
      }
  }

  void footer(const Sheet& sheet) {
    const double left = sheet_margin_mm, base = sheet.height - sheet_margin_mm - 4.5;
    line({left, base, left + ruler_mm, base});
    for (int mm = 0; mm <= int(ruler_mm); ++mm) {
      const double height = mm % 10 == 0 ? 4 : mm % 5 == 0 ? 3 : 1.5;
      line({left + mm, base, left + mm, base - height});
    }
    words({left + ruler_mm + 3, base, 2.2, "100 mm: if not, print at 100 %"});
    words({left, base + 4, 2.5, sheet.title});
  }

 private:
  cairo_t* cairo_;
};

}  // namespace

std::string pdf_of(const std::vector<Drawing>& drawings, const std::vector<Sheet>& sheets,
                   const std::string& title) {
  std::string content;
  const std::unique_ptr<cairo_surface_t, Closer> surface(
      cairo_pdf_surface_create_for_stream(append_bytes, &content, 1, 1));
  insist(cairo_surface_status(surface.get()));
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_TITLE, title.c_str());
  for (const Sheet& sheet : sheets) {
    cairo_pdf_surface_set_size(surface.get(), sheet.width * points_per_mm,
                               sheet.height * points_per_mm);
    const std::unique_ptr<cairo_t, Closer> cairo(cairo_create(surface.get()));
    cairo_scale(cairo.get(), points_per_mm, points_per_mm);
    Pen pen(cairo.get());
    for (const Placed& placed : sheet.placed) {
      pen.drawing(drawings[placed.drawing], placed);
      pen.crop_marks(placed.window);
    }
    pen.footer(sheet);
    cairo_show_page(cairo.get());
    insist(cairo_status(cairo.get()));
  }
  cairo_surface_finish(surface.get());
  insist(cairo_surface_status(surface.get()));
  return content;
}

}  // namespace previz::print
