#include "daemon/tools/print/print.hpp"

#include <fmt/ostream.h>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/calibrate/lens/length.hpp"
#include "daemon/tools/print/boards.hpp"
#include "daemon/tools/print/pdf.hpp"
#include "daemon/tools/print/tags.hpp"
#include "drivers/error.hpp"

namespace previz::print {
namespace {

TagSheet sheet_of(const TagOptions& options) {
  const auto size = calibrate::parse_length(options.size);
  if (!size)
    throw Error("size \"" + options.size +
                "\" is not valid; allowed: 80mm, 8cm, 0.08m or 3in, the side of the black "
                "border");
  return {options.family, parse_ids(options.ids), 1000 * *size};
}

void write(const std::vector<Drawing>& drawings, const PrintOptions& options,
           const std::string& title, std::ostream& out) {
  const std::vector<Sheet> sheets = lay_out(drawings, paper_by_name(options.paper), title);
  session::replace_file(options.file, pdf_of(drawings, sheets, title));
  fmt::print(out,
             "{}: {}, on {} sheet{} of {}\n"
             "Print at 100 % (not \"fit to page\"), and measure the ruler: it is 100 mm long.\n",
             options.file.string(), title, sheets.size(), sheets.size() == 1 ? "" : "s",
             options.paper);
}

}  // namespace

void print_tags(const TagOptions& options, std::ostream& out) {
  const TagSheet sheet = sheet_of(options);
  const std::vector<Drawing> drawings = draw_tags(sheet);
  write(drawings, options,
        drawings.size() == 1 ? drawings.front().name
                             : fmt::format("{} tags {} {}, {:g} mm", drawings.size(), sheet.family,
                                           options.ids, sheet.size_mm),
        out);
}

void print_block(const TagOptions& options, std::ostream& out) {
  const TagSheet sheet = sheet_of(options);
  const Drawing drawing = draw_block(sheet);
  write({drawing}, options, drawing.name, out);
  fmt::print(out, "Fold it around a cube of {:.1f} mm.\n", face_mm(sheet));
}

void print_stick(const TagOptions& options, std::ostream& out) {
  const TagSheet sheet = sheet_of(options);
  const Drawing drawing = draw_stick(sheet);
  write({drawing}, options, drawing.name, out);
  fmt::print(out, "Fold it around a square stick of {:.1f} mm.\n", face_mm(sheet));
}

void print_board(const BoardOptions& options, std::ostream& out) {
  const Drawing drawing = draw_board(calibrate::parse_board(options.board), options.board);
  write({drawing}, options, drawing.name, out);
}

}  // namespace previz::print
