#include "daemon/exchange/picture_sequence.hpp"

#include <fnmatch.h>
#include <string.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <optional>
#include <regex>
#include <string_view>

#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

namespace fs = std::filesystem;

// More than this of the numbers missing for each that is there, and they are not of frames.
constexpr std::uint64_t most_missing_for_each = 100;
// No file has a longer name; std::regex recurses.
constexpr std::size_t longest_name = 255;

std::vector<std::string> file_names(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder.empty() ? "." : folder, failure))
    if (!entry.is_directory()) names.push_back(entry.path().filename().string());
  if (failure) throw Error(folder.string() + ": cannot be listed: " + failure.message());
  return names;
}

std::optional<std::uint64_t> number_of(std::string_view digits) {
  std::uint64_t number = 0;
  const char* end = digits.data() + digits.size();
  const auto result = std::from_chars(digits.data(), end, number);
  return result.ec == std::errc{} && result.ptr == end ? std::optional(number) : std::nullopt;
}

// A file name with one number in it.
struct NumberPattern {
  std::string before;
  std::size_t digits = 1;  // at least, filled up with noughts
  bool any_padding = false;
  std::string after;
  std::optional<std::uint64_t> first, last;  // of a range
};

std::optional<NumberPattern> number_pattern(const std::string& name) {
  static const std::regex form(
      R"(^(.*?)(?:(\d+)-(\d+))?(?:%0([1-9])d|(%d)|(#+|@+)|\$F([1-9]?))(.*?)(?: +(\d+)-(\d+))?$)");
  std::smatch found;
  if (name.size() > longest_name || !std::regex_match(name, found, form)) return std::nullopt;
  NumberPattern pattern{found[1], 1, false, found[8], {}, {}};
  if (found[4].matched || found[7].length() > 0)
    pattern.digits = number_of((found[4].matched ? found[4] : found[7]).str()).value_or(1);
  else if (found[6].length() > 1)
    pattern.digits = static_cast<std::size_t>(found[6].length());
  else
    pattern.any_padding = !found[5].matched;
  for (const int at : {2, 9})
    if (found[at].matched) {
      pattern.first = number_of(found[at].str());
      pattern.last = number_of(found[at + 1].str());
    }
  return pattern;
}

// A number that is written as the pattern has it, or with too few digits, as programs do that
// forget the noughts.
std::optional<std::uint64_t> match(const NumberPattern& pattern, std::string_view name) {
  const auto& [before, digits, any_padding, after, first, last] = pattern;
  if (name.size() <= before.size() + after.size() || !name.starts_with(before) ||
      !name.ends_with(after))
    return std::nullopt;
  name.remove_prefix(before.size());
  name.remove_suffix(after.size());
  const bool is_padded = name.size() > 1 && name[0] == '0';
  if (is_padded && name.size() != digits && !any_padding) return std::nullopt;
  const auto number = number_of(name);
  if (number && ((first && *number < *first) || (last && *number > *last))) return std::nullopt;
  return number;
}

// The frame's number in names that differ in nothing else.
std::optional<NumberPattern> common_pattern(const std::vector<std::string>& names) {
  const std::string &one = names.front(), &other = names.back();
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto differs = std::ranges::mismatch(one, other);
  auto begin = static_cast<std::size_t>(differs.in1 - one.begin());
  while (begin > 0 && is_digit(one[begin - 1])) --begin;
  std::size_t end = begin;
  while (end < one.size() && is_digit(one[end])) ++end;
  if (end == begin) return std::nullopt;
  NumberPattern pattern{one.substr(0, begin), 1, true, one.substr(end), {}, {}};
  const bool all = std::ranges::all_of(
      names, [&](const std::string& name) { return match(pattern, name).has_value(); });
  return all ? std::optional(pattern) : std::nullopt;
}

std::string ranges_in_words(const std::vector<std::pair<std::uint64_t, std::uint64_t>>& ranges) {
  constexpr std::size_t most_named = 4;
  std::string words;
  for (std::size_t i = 0; i < ranges.size() && i < most_named; ++i) {
    const auto [first, last] = ranges[i];
    words += (i == 0 ? "" : ", ") + std::to_string(first);
    if (last > first) words += (last == first + 1 ? ", " : " to ") + std::to_string(last);
  }
  return words + (ranges.size() > most_named ? ", ..." : "");
}

using Numbered = std::map<std::uint64_t, std::string>;

Numbered numbered(const std::vector<std::string>& names, const NumberPattern& pattern,
                  const fs::path& path) {
  Numbered files;
  for (const std::string& name : names)
    if (const auto number = match(pattern, name))
      if (const auto [known, is_new] = files.try_emplace(*number, name); !is_new)
        throw Error(path.string() + ": the number " + std::to_string(*number) +
                    " is there twice, " + known->second + " and " + name + "; remove one");
  return files;
}

PictureSequence sequence_of(const Numbered& files, const NumberPattern& pattern,
                            const fs::path& path) {
  PictureSequence sequence;
  const std::uint64_t first = pattern.first.value_or(files.begin()->first);
  const std::uint64_t last = pattern.last.value_or(files.rbegin()->first);
  std::vector<std::pair<std::uint64_t, std::uint64_t>> holes;
  std::uint64_t next = first;
  for (const auto& [number, name] : files) {
    if (number > next) holes.emplace_back(next, number - 1);
    sequence.files.push_back(path.parent_path() / name);
    sequence.positions.push_back(number - first);
    next = number + 1;
  }
  if (last >= next) holes.emplace_back(next, last);
  for (const auto& [from, to] : holes) sequence.missing += to - from + 1;
  if (sequence.missing == 0) return sequence;
  if (sequence.missing / most_missing_for_each >= files.size()) {
    sequence = whole_sequence(std::move(sequence.files));
    sequence.words = path.string() + ": the numbers in the names, " + std::to_string(first) +
                     " to " + std::to_string(last) +
                     ", are not those of frames: the pictures are used one after the other";
    return sequence;
  }
  sequence.words = path.string() + ": " + ranges_in_words(holes) +
                   (sequence.missing == 1
                        ? " is missing: 1 frame is lost"
                        : " are missing: " + std::to_string(sequence.missing) + " frames are lost");
  return sequence;
}

}  // namespace

PictureSequence whole_sequence(std::vector<fs::path> files) {
  PictureSequence sequence{std::move(files), {}, 0, {}};
  for (std::size_t i = 0; i < sequence.files.size(); ++i) sequence.positions.push_back(i);
  return sequence;
}

PictureSequence picture_sequence(const fs::path& path) {
  const std::string name = path.filename().string();
  std::error_code none;
  if (fs::is_regular_file(path, none)) return whole_sequence({path});
  std::optional<NumberPattern> pattern = number_pattern(name);
  std::vector<std::string> names;
  if (pattern) {
    names = file_names(path.parent_path());
  } else if (name.find_first_of("*?") != std::string::npos) {
    for (const std::string& file : file_names(path.parent_path()))
      if (::fnmatch(name.c_str(), file.c_str(), FNM_PERIOD) == 0) names.push_back(file);
    std::ranges::sort(names, [](const std::string& a, const std::string& b) {
      return ::strverscmp(a.c_str(), b.c_str()) < 0;
    });
    if (names.size() > 1) pattern = common_pattern(names);
  }
  if (pattern) {
    const Numbered files = numbered(names, *pattern, path);
    if (!files.empty()) return sequence_of(files, *pattern, path);
  } else if (!names.empty()) {
    std::vector<fs::path> files;
    for (const std::string& file : names) files.push_back(path.parent_path() / file);
    return whole_sequence(std::move(files));
  }
  throw Error(path.string() + ": file not found");
}

}  // namespace previz::exchange
