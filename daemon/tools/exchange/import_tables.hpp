// Reads tables of frames (CSV).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace previz::exchange {

struct Table {
  std::filesystem::path file;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;  // each as long as `columns`

  // Returns the column's cells, top to bottom; empty if there is no such column.
  std::vector<std::string> column(const std::string& name) const;
};

// Reads a comma-separated table with a header line and at least one row, without quotes. Throws
// previz::Error naming file and line.
Table read_csv(const std::filesystem::path& file);

}  // namespace previz::exchange
