#include "daemon/core/set/problems.hpp"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "drivers/error.hpp"

namespace previz::set {

void Problems::add(Position at, const std::string& key, const std::string& what) {
  problems_.push_back({at, key, what});
}

void Problems::go_on_with(std::string file, std::uint32_t lines) {
  next_file_ = std::move(file);
  lines_ = lines;
}

void Problems::throw_if_any() const {
  if (problems_.empty()) return;
  auto sorted = problems_;
  std::ranges::stable_sort(sorted, {}, [](const Problem& p) { return p.at; });
  std::string message;
  for (const auto& [at, key, what] : sorted) {
    if (!message.empty()) message += '\n';
    const bool is_next = lines_ && at.line > *lines_;
    message += printable(is_next ? next_file_ : file_) + ':' +
               std::to_string(is_next ? at.line - *lines_ : at.line) + ':' +
               std::to_string(at.column) + ": " + (key.empty() ? "" : printable(key) + ": ") +
               printable(what);
  }
  throw Error(message);
}

namespace {

// Optimal string alignment: insertions, deletions, substitutions and swaps of neighbours cost 1.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before, last(b.size() + 1), row(b.size() + 1);
  std::iota(last.begin(), last.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    before = last;
    last = row;
  }
  return last.back();
}

}  // namespace

std::string nearest(const std::string& word, const std::vector<std::string>& known) {
  constexpr std::size_t longest_word = 64;  // longer ones are no slip of the hand
  if (word.size() > longest_word) return "";
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const auto& candidate : known) {
    // "focal_length" means "focal_length_mm": a forgotten unit is the likeliest slip of all.
    const bool unit_forgotten = word.size() > 2 && candidate.starts_with(word + "_");
    const auto distance = unit_forgotten ? 0 : edit_distance(word, candidate);
    if (distance < best_distance && distance < candidate.size()) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

}  // namespace previz::set
