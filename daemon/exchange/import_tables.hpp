// Lists of files: a table (CSV) or the files that a pattern matches.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace previz::exchange {

struct Table {
  std::filesystem::path file;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;  // each as long as `columns`

  // The column's cells, top to bottom; empty if there is no such column.
  std::vector<std::string> column(const std::string& name) const;
};

// Comma-separated, a header line and at least one row, no quotes. Throws previz::Error naming file
// and line.
Table read_csv(const std::filesystem::path& file);

// One number "%d" or "%0Nd" in the file name: all such files, by number, without a gap. Wildcards *
// and ? in the file name: all such files, the numbers in their names by value. Otherwise the file.
// Throws previz::Error if there is none, or a number is missing.
std::vector<std::filesystem::path> matching_files(const std::filesystem::path& pattern);

}  // namespace previz::exchange
