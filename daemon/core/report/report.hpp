// A report is one thing that whoever runs the rig should know, as plain data.
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

// Returns the severity of one of the names above; the least severe for any other name.
inline Severity severity_named(std::string_view name) {
  const auto* const found = std::ranges::find(
      severities, name, [](const auto& known) { return std::string_view(known.first); });
  return found == severities.end() ? Severity::info : found->second;
}

// A line on the display, in the crew's words. A trouble has a source and is replaced by a newer
// trouble of the same source; news has no source.
struct Notice {
  Severity severity = Severity::info;
  std::string source;  // "film camera"
  std::string text;    // "was unplugged"
  bool lasts = false;  // shown until settled; otherwise only long enough to be read

  friend bool operator==(const Notice&, const Notice&) = default;
};

struct Report {
  Severity severity = Severity::info;
  std::string source;    // who reports: "light", "button red"; may be empty
  std::string text;      // the first of its lines says what happened
  std::string key = {};  // reports with equal keys are repetitions of one; empty: of none
  std::optional<Notice> notice = {};  // shown on the display, every time
  bool logs_all = false;              // with a key: whether all repetitions are logged, or few
};

// Returns "film camera: was unplugged", or the text alone if there is no source.
template <class T>
std::string line_of(const T& said) {
  return said.source.empty() ? said.text : said.source + ": " + said.text;
}

// Returns a line without its digits: a key that stays the same while the figures in the line
// change.
inline std::string wording(const std::string& line) {
  std::string words;
  std::ranges::remove_copy_if(line, std::back_inserter(words),
                              [](char c) { return c >= '0' && c <= '9'; });
  return words;
}

// Returns the report of a state that may be reported with every frame. Whatever figures are in it,
// it is logged the first time, and the 10th, 100th, 1000th time with that number.
inline Report once(Report report) {
  report.key = wording(line_of(report));
  return report;
}

// Returns the report of an event, such as the loss of a device. It is logged every time, from the
// second on with its number.
inline Report counted(Report report) {
  report.key = wording(line_of(report));
  report.logs_all = true;
  return report;
}

// Returns a trouble that stands on the display until Reports::settle(source).
inline Notice lasting(std::string source, std::string text) {
  return {Severity::error, std::move(source), std::move(text), true};
}

// Returns a trouble that is over already.
inline Notice passing(std::string source, std::string text) {
  return {Severity::error, std::move(source), std::move(text), false};
}

// Remembers which keys were seen before. Not thread-safe.
class Once {
 public:
  // Returns true the first time it is called with this key.
  bool is_first(std::string key) { return seen_.insert(std::move(key)).second; }

 private:
  std::set<std::string> seen_;
};

}  // namespace previz::report
