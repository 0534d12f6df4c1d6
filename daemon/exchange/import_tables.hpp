// Reads lists of files, from a table (CSV) or from a pattern.
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

// Returns the files that match. With one number "%d" or "%0Nd" in the file name these are all such
// files by number, without a gap; with wildcards * and ?, all such files, ordered with the numbers
// in their names by value; otherwise the file itself. Throws previz::Error if there is none, or a
// number is missing.
std::vector<std::filesystem::path> matching_files(const std::filesystem::path& pattern);

}  // namespace previz::exchange
