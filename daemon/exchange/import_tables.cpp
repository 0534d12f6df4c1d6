#include "daemon/exchange/import_tables.hpp"

#include <fnmatch.h>
#include <string.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <optional>
#include <sstream>

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

std::vector<std::string> file_names(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code failure;
  for (const auto& entry :
       std::filesystem::directory_iterator(folder.empty() ? "." : folder, failure))
    if (!entry.is_directory()) names.push_back(entry.path().filename().string());
  if (failure) throw Error(folder.string() + ": cannot be listed: " + failure.message());
  return names;
}

// A file name with one number in it: "%d", or "%0Nd" of at least N digits.
struct NumberPattern {
  std::string before;
  std::size_t digits = 1;
  std::string after;
};

std::optional<NumberPattern> number_pattern(const std::string& name) {
  for (auto at = name.find('%'); at != std::string::npos; at = name.find('%', at + 1)) {
    NumberPattern pattern{name.substr(0, at), 1, {}};
    std::size_t end = at + 1;
    if (end + 1 < name.size() && name[end] == '0' && name[end + 1] >= '1' && name[end + 1] <= '9') {
      pattern.digits = static_cast<std::size_t>(name[end + 1] - '0');
      end += 2;
    }
    if (end >= name.size() || name[end] != 'd') continue;
    pattern.after = name.substr(end + 1);
    return pattern;
  }
  return std::nullopt;
}

struct Numbered {
  std::uint64_t number;
  std::string name;
};

std::optional<Numbered> match(const NumberPattern& pattern, const std::string& name) {
  const auto& [before, digits, after] = pattern;
  if (name.size() < before.size() + digits + after.size() || !name.starts_with(before) ||
      !name.ends_with(after))
    return std::nullopt;
  const char* first = name.data() + before.size();
  const char* last = name.data() + name.size() - after.size();
  std::uint64_t number = 0;
  const auto result = std::from_chars(first, last, number);
  const bool padded_further = static_cast<std::size_t>(last - first) > digits && *first == '0';
  if (result.ec != std::errc{} || result.ptr != last || padded_further) return std::nullopt;
  return Numbered{number, name};
}

std::vector<std::string> numbered_files(const std::filesystem::path& path,
                                        const NumberPattern& pattern) {
  std::vector<Numbered> found;
  for (const std::string& name : file_names(path.parent_path()))
    if (auto file = match(pattern, name)) found.push_back(std::move(*file));
  std::ranges::sort(found, {}, &Numbered::number);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (i > 0 && found[i].number != found[i - 1].number + 1)
      throw Error(path.string() + ": number " + std::to_string(found[i - 1].number + 1) +
                  " is missing; there are numbers up to " + std::to_string(found.back().number));
    names.push_back(found[i].name);
  }
  return names;
}

std::vector<std::string> wildcard_files(const std::filesystem::path& pattern) {
  std::vector<std::string> names;
  for (const std::string& name : file_names(pattern.parent_path()))
    if (::fnmatch(pattern.filename().c_str(), name.c_str(), FNM_PERIOD) == 0) names.push_back(name);
  std::ranges::sort(names, [](const std::string& a, const std::string& b) {
    return ::strverscmp(a.c_str(), b.c_str()) < 0;
  });
  return names;
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
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error(file.string() + ": cannot be opened: " + std::strerror(errno));
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

std::vector<std::filesystem::path> matching_files(const std::filesystem::path& pattern) {
  const std::string name = pattern.filename().string();
  std::vector<std::string> names;
  if (const auto numbers = number_pattern(name))
    names = numbered_files(pattern, *numbers);
  else if (name.find_first_of("*?") != std::string::npos)
    names = wildcard_files(pattern);
  else
    names = {name};
  if (names.empty()) throw Error(pattern.string() + ": file not found");
  std::vector<std::filesystem::path> files;
  for (const std::string& found : names) files.push_back(pattern.parent_path() / found);
  return files;
}

}  // namespace previz::exchange
