// The time of frames before which something changed, beside that of frames before which nothing
// did. Both alternate.
#pragma once

#include <cstdint>
#include <cstdio>
#include <vector>

#include "tests/bench/measure.hpp"
#include "tests/bench/view_from_above.hpp"

namespace previz::bench {

// [0]: of frames before which nothing changed, [1]: something did. In CPU time: the machine may be
// busy.
struct ChangeTimes {
  std::vector<double> placed_ms[2], whole_ms[2];  // until the first ray, and of the frame
  std::uint64_t rebuilt_trees = 0;                // in all frames
};

// Renders `rounds` frames of each kind, of one sample. `prepare` is called before each, outside of
// its time, with its number from -2 on, and returns what makes the change.
template <class Prepare>
ChangeTimes time_changes(const ViewFromAbove& view, int rounds, Prepare prepare) {
  render::Renderer& renderer = *view.renderer;
  ChangeTimes times;
  for (int round = -2; round < 2 * rounds; ++round) {
    const std::size_t changed = round & 1;
    const auto change = prepare(round);
    const double start = cpu_seconds();
    if (changed != 0) change();
    renderer.begin(view.frame);
    const double placed = cpu_seconds();
    renderer.render(1);
    const double end = cpu_seconds();
    times.rebuilt_trees += renderer.counters().rebuilt_trees;
    if (round < 0) continue;  // compiles the pipelines
    times.placed_ms[changed].push_back(1e3 * (placed - start));
    times.whole_ms[changed].push_back(1e3 * (end - start));
  }
  return times;
}

// Prints the medians as a table; `changed` names the frames before which something changed.
inline void print_changes(const ChangeTimes& times, const char* changed) {
  std::printf("| frame | until the first ray | whole |\n| --- | --- | --- |\n");
  for (const std::size_t kind : {0, 1})
    std::printf("| %s | %.2f | %.1f |\n", kind != 0 ? changed : "still",
                median(times.placed_ms[kind]), median(times.whole_ms[kind]));
}

}  // namespace previz::bench
