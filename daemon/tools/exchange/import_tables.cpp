#include "daemon/tools/exchange/import_tables.hpp"

#include <algorithm>
#include <sstream>

#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

std::vector<std::string> split(std::string line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
  std::vector<std::string> cells;
  std::istringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
  if (line.empty() || line.back() == ',') cells.emplace_back();
  return cells;
}

}  // namespace

std::vector<std::string> Table::column(const std::string& name) const {
  const auto found = std::ranges::find(columns, name);
  std::vector<std::string> cells;
  if (found == columns.end()) return cells;
  for (const auto& row : rows) cells.push_back(row[found - columns.begin()]);
  return cells;
}

Table read_csv(const std::filesystem::path& file) {
  std::istringstream stream(session::read_file(file, {"a table (CSV)", 1 << 28}));
  Table table;
  table.file = file;
  std::string line;
  for (std::size_t number = 1; std::getline(stream, line); ++number) {
    const std::string at = file.string() + ":" + std::to_string(number) + ": ";
    if (line.find('"') != std::string::npos) throw Error(at + "quotes are not allowed");
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
    if (line.empty() || line == "\r") continue;
    std::vector<std::string> cells = split(line);
    if (table.columns.empty()) {
      table.columns = std::move(cells);
      continue;
    }
    if (cells.size() != table.columns.size())
      throw Error(at + "has " + std::to_string(cells.size()) + " cells; the header line has " +
                  std::to_string(table.columns.size()));
    table.rows.push_back(std::move(cells));
  }
  if (table.rows.empty())
    throw Error(file.string() + ": has no rows; allowed: a header line and one line per frame");
  return table;
}

}  // namespace previz::exchange
