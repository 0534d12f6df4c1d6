#include "daemon/tools/exchange/picture_sequence.hpp"

#include <fnmatch.h>
#include <string.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
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
// Numbers of as many digits are times: "20261129114510".
constexpr std::uint64_t least_time = 100'000'000'000;
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

// Returns what the name may mean, likelier first: a letter that marks a number may also be part of
// a name.
std::vector<NumberPattern> number_patterns(const std::string& name) {
  static const std::array<std::regex, 2> forms = {
      std::regex(R"(^(.*?)(?:(\d+)-(\d+))?(?:%0([1-9])d|(%d))(.*?)(?: +(\d+)-(\d+))?$)"),
      std::regex(R"(^(.*?)(?:(\d+)-(\d+))?(?:\$F([1-9]?)|(#+|@+))(.*?)(?: +(\d+)-(\d+))?$)")};
  std::vector<NumberPattern> patterns;
  for (const std::regex& form : forms) {
    std::smatch found;
    if (name.size() > longest_name || !std::regex_match(name, found, form)) continue;
    NumberPattern pattern{found[1], 1, false, found[6], {}, {}};
    const std::string mark = found[5];
    if (found[4].length() > 0)
      pattern.digits = number_of(found[4].str()).value_or(1);
    else if (mark != "%d")
      pattern.digits = std::max<std::size_t>(1, mark.size());
    pattern.any_padding = pattern.digits == 1 && mark != "%d";
    for (const int at : {2, 7})
      if (found[at].matched) {
        pattern.first = number_of(found[at].str());
        pattern.last = number_of(found[at + 1].str());
      }
    patterns.push_back(pattern);
    if (!found[2].matched) continue;
    pattern.before += found[2].str() + "-" + found[3].str();  // no range, but part of the name
    pattern.first = pattern.last = std::nullopt;
    patterns.push_back(pattern);
  }
  static const std::regex range(R"(^(.*?)[\[{](\d+)(?:-|\.\.)(\d+)[\]}](.*)$)");
  std::smatch found;
  if (name.size() <= longest_name && std::regex_match(name, found, range))
    patterns.push_back({found[1], static_cast<std::size_t>(found[2].length()), false, found[4],
                        number_of(found[2].str()), number_of(found[3].str())});
  return patterns;
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

// Where two names have one number, one with the pattern's digits goes before one with fewer.
Numbered numbered(const std::vector<std::string>& names, const NumberPattern& pattern,
                  const fs::path& path) {
  const std::size_t whole = pattern.before.size() + pattern.digits + pattern.after.size();
  Numbered files;
  for (const std::string& name : names) {
    const auto number = match(pattern, name);
    if (!number) continue;
    const auto [known, is_new] = files.try_emplace(*number, name);
    if (is_new || (known->second.size() >= whole && name.size() < whole)) continue;
    if (known->second.size() >= whole)
      throw Error(path.string() + ": the number " + std::to_string(*number) + " is there twice, " +
                  known->second + " and " + name + "; remove one");
    known->second = name;
  }
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
  if (sequence.missing / most_missing_for_each >= files.size() || last >= least_time) {
    sequence = whole_sequence(std::move(sequence.files));
    sequence.words = path.string() + ": the numbers in the names, " + std::to_string(first) +
                     " to " + std::to_string(last) +
                     ", do not count frames: the pictures are used one after the other";
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
  const std::vector<std::string> all = file_names(path.parent_path());
  if (name.find_first_of("*?") != std::string::npos) {
    std::vector<std::string> names;
    std::ranges::copy_if(all, std::back_inserter(names), [&](const std::string& file) {
      return ::fnmatch(name.c_str(), file.c_str(), FNM_PERIOD) == 0;
    });
    std::ranges::sort(names, [](const std::string& a, const std::string& b) {
      return ::strverscmp(a.c_str(), b.c_str()) < 0;
    });
    if (const auto pattern = names.size() > 1 ? common_pattern(names) : std::nullopt)
      return sequence_of(numbered(names, *pattern, path), *pattern, path);
    std::vector<fs::path> files;
    for (const std::string& file : names) files.push_back(path.parent_path() / file);
    if (!files.empty()) return whole_sequence(std::move(files));
  } else {
    for (const NumberPattern& pattern : number_patterns(name))
      if (const Numbered files = numbered(all, pattern, path); !files.empty())
        return sequence_of(files, pattern, path);
  }
  throw Error(path.string() + ": file not found");
}

}  // namespace previz::exchange
