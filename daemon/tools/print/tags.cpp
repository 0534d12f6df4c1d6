#include "daemon/tools/print/tags.hpp"

#include <fmt/format.h>

#include <charconv>
#include <sstream>

#include "daemon/tools/print/tag_cells.hpp"
#include "drivers/error.hpp"

namespace previz::print {
namespace {

constexpr double label_mm = 5, letter_mm = 2.5;
constexpr double flap_mm = 8;
constexpr double least_cell_mm = 0.4;  // of office printers, about ten dots

double cell_of(const TagSheet& sheet) {
  const double cell = sheet.size_mm / family_shape(sheet.family).border;
  if (cell < least_cell_mm)
    throw Error(fmt::format(
        "tags of {:g} mm have cells of {:.2f} mm, which printers blur; {} needs "
        "{:g} mm or more",
        sheet.size_mm, cell, sheet.family, least_cell_mm * family_shape(sheet.family).border));
  return cell;
}

std::string name_of(const TagSheet& sheet, const std::string& ids) {
  return fmt::format("{} id {}, {:g} mm", sheet.family, ids, sheet.size_mm);
}

void outline(const Rectangle& r, bool fold, Drawing& drawing) {
  drawing.lines.push_back({r.x, r.y, r.x + r.width, r.y, fold});
  drawing.lines.push_back({r.x, r.y + r.height, r.x + r.width, r.y + r.height, fold});
  drawing.lines.push_back({r.x, r.y, r.x, r.y + r.height, fold});
  drawing.lines.push_back({r.x + r.width, r.y, r.x + r.width, r.y + r.height, fold});
}

// A face of a block or a stick, with its id in the margin.
void add_face(const TagSheet& sheet, int id, double x, double y, Drawing& drawing) {
  const double cell = cell_of(sheet);
  add_tag_cells(sheet.family, id, x + cell, y + cell, cell, drawing);
  const double height = std::min(letter_mm, 0.6 * cell);
  drawing.words.push_back({x + cell, y + face_mm(sheet) - 0.25 * cell, height, std::to_string(id)});
}

// A flap for glue along one side of a face: `dx` or `dy` is -1 or 1, the other 0.
void add_flap(const Rectangle& face, int dx, int dy, Drawing& drawing) {
  const double x = dx > 0 ? face.x + face.width : face.x;
  const double y = dy > 0 ? face.y + face.height : face.y;
  const double end_x = dx ? x : face.x + face.width, end_y = dy ? y : face.y + face.height;
  const double in_x = dx ? 0 : flap_mm / 2, in_y = dy ? 0 : flap_mm / 2;
  const double out_x = dx * flap_mm, out_y = dy * flap_mm;
  drawing.lines.push_back({x, y, end_x, end_y, true});
  drawing.lines.push_back({x, y, x + in_x + out_x, y + in_y + out_y});
  drawing.lines.push_back(
      {x + in_x + out_x, y + in_y + out_y, end_x - in_x + out_x, end_y - in_y + out_y});
  drawing.lines.push_back({end_x - in_x + out_x, end_y - in_y + out_y, end_x, end_y});
}

std::string words_of_ids(const std::vector<int>& ids) {
  std::string text;
  for (const int id : ids) add_to_list(text, std::to_string(id), " ");
  return text;
}

}  // namespace

std::vector<int> parse_ids(const std::string& text) {
  constexpr int most = 10'000;
  std::vector<int> ids;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) {
    int first = -1, last = -1;
    const char* const end = part.data() + part.size();
    auto read = std::from_chars(part.data(), end, first);
    last = first;
    if (read.ec == std::errc{} && read.ptr != end && *read.ptr == '-')
      read = std::from_chars(read.ptr + 1, end, last);
    if (read.ec != std::errc{} || read.ptr != end || first < 0 || last < first ||
        last - first > most)
      throw Error("ids \"" + part + "\" are not valid; allowed: 0-11,20");
    for (int id = first; id <= last; ++id) ids.push_back(id);
  }
  if (ids.empty()) throw Error("no ids given; allowed: 0-11,20");
  return ids;
}

double face_mm(const TagSheet& sheet) {
  return (family_shape(sheet.family).total + 2) * cell_of(sheet);
}

std::vector<Drawing> draw_tags(const TagSheet& sheet) {
  const double cell = cell_of(sheet), face = face_mm(sheet);
  std::vector<Drawing> drawings;
  for (const int id : sheet.ids) {
    Drawing drawing;
    drawing.width = face;
    drawing.height = face + label_mm;
    drawing.name = name_of(sheet, std::to_string(id));
    add_tag_cells(sheet.family, id, cell, cell, cell, drawing);
    drawing.words.push_back({cell, face + label_mm - 1.5, letter_mm, drawing.name});
    drawings.push_back(std::move(drawing));
  }
  return drawings;
}

Drawing draw_block(const TagSheet& sheet) {
  if (sheet.ids.size() != 5 && sheet.ids.size() != 6)
    throw Error(
        "a block has 5 or 6 tags: four around it, one above, and one below or none; these "
        "are " +
        std::to_string(sheet.ids.size()));
  const double face = face_mm(sheet);
  Drawing drawing;
  drawing.width = 4 * face + flap_mm;
  drawing.height = 3 * face + 2 * flap_mm;
  drawing.name = "block, " + name_of(sheet, words_of_ids(sheet.ids));
  for (int side = 0; side < 4; ++side) {
    const Rectangle at{side * face, face + flap_mm, face, face};
    outline(at, true, drawing);
    add_face(sheet, sheet.ids[std::size_t(side)], at.x, at.y, drawing);
  }
  add_flap({3 * face, face + flap_mm, face, face}, 1, 0, drawing);
  const Rectangle upper{face, flap_mm, face, face}, lower{face, 2 * face + flap_mm, face, face};
  add_face(sheet, sheet.ids[4], upper.x, upper.y, drawing);
  if (sheet.ids.size() == 6) add_face(sheet, sheet.ids[5], lower.x, lower.y, drawing);
  for (const int dx : {-1, 1}) {
    add_flap(upper, dx, 0, drawing);
    add_flap(lower, dx, 0, drawing);
  }
  add_flap(upper, 0, -1, drawing);
  add_flap(lower, 0, 1, drawing);
  return drawing;
}

Drawing draw_stick(const TagSheet& sheet) {
  if (sheet.ids.size() % 4 != 0)
    throw Error(
        "a stick has rings of four tags: give 4, 8, 12 ... ids; "
        "these are " +
        std::to_string(sheet.ids.size()));
  const double face = face_mm(sheet);
  const auto rings = int(sheet.ids.size() / 4);
  Drawing drawing;
  drawing.width = 4 * face + flap_mm;
  drawing.height = rings * face;
  drawing.name = "stick, " + name_of(sheet, words_of_ids(sheet.ids));
  for (int ring = 0; ring < rings; ++ring)
    for (int side = 0; side < 4; ++side)
      add_face(sheet, sheet.ids[std::size_t(4 * ring + side)], side * face, ring * face, drawing);
  for (int side = 1; side <= 4; ++side)
    drawing.lines.push_back({side * face, 0, side * face, drawing.height, true});
  outline({0, 0, drawing.width, drawing.height}, false, drawing);
  return drawing;
}

}  // namespace previz::print
