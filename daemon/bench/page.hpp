// Writes what `previzd bench` measured as a page for people.
#pragma once

#include <string>

#include "daemon/bench/figures.hpp"

namespace previz::bench {

// Returns one HTML file that needs no other files.
std::string bench_page(const BenchReport& report);

}  // namespace previz::bench
