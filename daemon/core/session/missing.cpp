#include "daemon/core/session/missing.hpp"

namespace previz::session {
namespace {

struct Run {
  std::uint64_t first, last;
};

std::vector<Run> runs_of(const std::vector<std::uint64_t>& numbers) {
  std::vector<Run> runs;
  for (const std::uint64_t number : numbers) {
    if (!runs.empty() && runs.back().last + 1 == number)
      runs.back().last = number;
    else
      runs.push_back({number, number});
  }
  return runs;
}

std::string text(const Run& run) {
  if (run.first == run.last) return std::to_string(run.first);
  return std::to_string(run.first) + " to " + std::to_string(run.last);
}

}  // namespace

std::string count_of(const std::string& noun, std::uint64_t count) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

std::string list_of(const std::string& noun, const std::vector<std::uint64_t>& numbers) {
  constexpr std::size_t shown = 10;
  const std::vector<Run> runs = runs_of(numbers);
  std::string list = noun + (numbers.size() == 1 ? " " : "s ");
  std::uint64_t named = 0;
  for (std::size_t i = 0; i < runs.size() && i < shown; ++i) {
    const bool last = i + 1 == runs.size();
    if (i > 0) list += last ? " and " : ", ";
    list += text(runs[i]);
    named += runs[i].last - runs[i].first + 1;
  }
  if (named < numbers.size()) list += " and " + std::to_string(numbers.size() - named) + " more";
  return list;
}

}  // namespace previz::session
