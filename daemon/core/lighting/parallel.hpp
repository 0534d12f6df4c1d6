// Splits the rows of a map over the few threads that lighting may use beside the renderer.
#pragma once

#include <algorithm>
#include <future>
#include <thread>
#include <vector>

namespace previz::lighting {

inline constexpr int max_threads = 2;

// Returns how many threads a command may use that runs alone.
inline int all_threads() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

// Calls body(begin, end) on contiguous blocks that together are [0, count), concurrently. The
// result must not depend on where the blocks are split. An exception thrown in a block is
// rethrown.
template <typename Body>
void parallel_blocks(int count, const Body& body, int most_threads = max_threads) {
  const int threads = std::min(all_threads(), most_threads);
  std::vector<std::future<void>> others;
  for (int t = 1; t < threads; ++t)
    others.push_back(std::async(std::launch::async, [&body, count, threads, t] {
      body(count * t / threads, count * (t + 1) / threads);
    }));
  body(0, count / threads);
  for (auto& other : others) other.get();
}

}  // namespace previz::lighting
