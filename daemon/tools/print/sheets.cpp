#include "daemon/tools/print/sheets.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "drivers/error.hpp"

namespace previz::print {
namespace {

constexpr double rounding_mm = 1e-6;

// The part of a sheet that drawings may take.
Rectangle area_of(const Sheet& sheet) {
  return {sheet_margin_mm, sheet_margin_mm, sheet.width - 2 * sheet_margin_mm,
          sheet.height - 2 * sheet_margin_mm - sheet_footer_mm};
}

// Upright first, so that it is kept where turning brings nothing.
std::vector<Sheet> both_ways(const Paper& paper) {
  return {{paper.width, paper.height, {}, ""}, {paper.height, paper.width, {}, ""}};
}

struct Grid {
  Sheet sheet;
  int columns = 0, rows = 0;
  int count() const { return columns * rows; }
};

// Returns how many drawings go on a sheet, crop marks included.
Grid several(const Drawing& drawing, const Sheet& sheet) {
  const Rectangle area = area_of(sheet);
  const auto fit = [](double room, double each) {
    return int((room + gutter_mm + rounding_mm) / (each + gutter_mm));
  };
  return {sheet, fit(area.width, drawing.width), fit(area.height, drawing.height)};
}

// Returns how many sheets a drawing is cut into.
Grid tiles(const Drawing& drawing, const Sheet& sheet) {
  const Rectangle area = area_of(sheet);
  const auto need = [](double size, double room) {
    return int(std::ceil((size - rounding_mm) / room));
  };
  return {sheet, need(drawing.width, area.width), need(drawing.height, area.height)};
}

std::vector<Sheet> on_grid(const std::vector<Drawing>& drawings, const Grid& grid,
                           const std::string& title) {
  const std::size_t pages =
      (drawings.size() + std::size_t(grid.count()) - 1) / std::size_t(grid.count());
  std::vector<Sheet> sheets;
  for (std::size_t i = 0; i < drawings.size(); ++i) {
    const int place = int(i) % grid.count();
    if (place == 0) {
      sheets.push_back(grid.sheet);
      sheets.back().title = title;
      if (pages > 1) sheets.back().title += fmt::format("; sheet {} of {}", sheets.size(), pages);
    }
    const int column = place % grid.columns, row = place / grid.columns;
    const Rectangle window{sheet_margin_mm + column * (drawings[i].width + gutter_mm),
                           sheet_margin_mm + row * (drawings[i].height + gutter_mm),
                           drawings[i].width, drawings[i].height};
    sheets.back().placed.push_back({i, window.x, window.y, window});
  }
  return sheets;
}

void add_tiles(const std::vector<Drawing>& drawings, std::size_t index, const Grid& grid,
               std::vector<Sheet>& sheets) {
  const Drawing& drawing = drawings[index];
  const double width = drawing.width / grid.columns, height = drawing.height / grid.rows;
  for (int row = 0; row < grid.rows; ++row)
    for (int column = 0; column < grid.columns; ++column) {
      Sheet sheet = grid.sheet;
      sheet.title = fmt::format("{}; column {} of {}, row {} of {}", drawing.name, column + 1,
                                grid.columns, row + 1, grid.rows);
      const Rectangle window{sheet_margin_mm, sheet_margin_mm, width, height};
      sheet.placed.push_back({index, window.x - column * width, window.y - row * height, window});
      sheets.push_back(std::move(sheet));
    }
}

}  // namespace

Paper paper_by_name(const std::string& name) {
  const Paper papers[] = {{"A4", 210, 297}, {"A3", 297, 420}, {"Letter", 215.9, 279.4}};
  std::string known;
  for (const Paper& paper : papers) {
    if (paper.name == name) return paper;
    add_to_list(known, paper.name);
  }
  throw Error("paper \"" + name + "\" is unknown; known: " + known);
}

std::vector<Sheet> lay_out(const std::vector<Drawing>& drawings, const Paper& paper,
                           const std::string& title) {
  std::optional<Grid> best;
  for (const Sheet& sheet : both_ways(paper))
    if (const Grid grid = several(drawings.front(), sheet);
        grid.columns > 0 && grid.rows > 0 && (!best || grid.count() > best->count()))
      best = grid;
  if (best) return on_grid(drawings, *best, title);

  for (const Sheet& sheet : both_ways(paper))
    if (const Grid grid = tiles(drawings.front(), sheet); !best || grid.count() < best->count())
      best = grid;
  if (best->count() > most_sheets_of_a_drawing)
    throw Error(
        fmt::format("{} is {:.0f} mm x {:.0f} mm and would take {} sheets of {}; at most {} "
                    "are allowed: choose a smaller size or larger paper",
                    drawings.front().name, drawings.front().width, drawings.front().height,
                    best->count(), paper.name, most_sheets_of_a_drawing));
  std::vector<Sheet> sheets;
  for (std::size_t i = 0; i < drawings.size(); ++i) add_tiles(drawings, i, *best, sheets);
  return sheets;
}

}  // namespace previz::print
