// One thing that whoever runs the rig should know, as plain data.
#pragma once

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace previz::report {

enum class Severity { info, warning, error };

inline constexpr std::array<std::pair<const char*, Severity>, 3> severities = {
    {{"info", Severity::info}, {"warning", Severity::warning}, {"error", Severity::error}}};

// By one of the names above; the least severe for any other.
inline Severity severity_named(std::string_view name) {
  const auto* const found = std::ranges::find(
      severities, name, [](const auto& known) { return std::string_view(known.first); });
  return found == severities.end() ? Severity::info : found->second;
}

// A line on the display, in the crew's words. A trouble has a source, and a newer one of the same
// source takes its place; news has none.
struct Notice {
  Severity severity = Severity::info;
  std::string source;  // "film camera"
  std::string text;    // "was unplugged"
  bool lasts = false;  // until it is settled; otherwise it stands long enough to be read

  friend bool operator==(const Notice&, const Notice&) = default;
};

struct Report {
  Severity severity = Severity::info;
  std::string source;                 // who reports: "light", "button red"; may be empty
  std::string text;                   // the first of its lines says what happened
  std::string once_key = {};          // equal ones are logged once; empty: every time
  std::optional<Notice> notice = {};  // what the display says of it, every time
};

// "film camera: was unplugged"; the text alone where there is no source.
template <class T>
std::string line_of(const T& said) {
  return said.source.empty() ? said.text : said.source + ": " + said.text;
}

// A line without its figures: the key under which what changes with every frame is the same.
inline std::string wording(const std::string& line) {
  std::string words;
  std::ranges::remove_copy_if(line, std::back_inserter(words),
                              [](char c) { return c >= '0' && c <= '9'; });
  return words;
}

// The same report, to be logged once, whatever figures are in it.
inline Report once(Report report) {
  report.once_key = wording(line_of(report));
  return report;
}

// A trouble that stands on the display until Reports::settle(source).
inline Notice lasting(std::string source, std::string text) {
  return {Severity::error, std::move(source), std::move(text), true};
}

// A trouble that is over already.
inline Notice passing(std::string source, std::string text) {
  return {Severity::error, std::move(source), std::move(text), false};
}

// Keys that were seen before. Not thread-safe.
class Once {
 public:
  // True the first time this key is asked for.
  bool is_first(std::string key) { return seen_.insert(std::move(key)).second; }

 private:
  std::set<std::string> seen_;
};

}  // namespace previz::report
