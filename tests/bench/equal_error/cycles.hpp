// Uses Blender Cycles' shadow catcher as a method: runs tests/bench/cycles/shadow_catcher.py and
// reads its pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/truth/compare.hpp"

namespace previz::bench {

struct CyclesOptions {
  std::string blender;           // the shell command that starts it
  std::filesystem::path script;  // shadow_catcher.py
  std::filesystem::path set;
  int frame = 0, width = 160, threads = 1;
};

struct CyclesRender {
  int samples = 0;
  double cpu_s = 0;  // of all threads, without what renders share
  std::filesystem::path file;
};

// "Blender 4.3.2", as the command says of itself. Throws previz::Error where it does not run.
std::string blender_version(const std::string& blender);

// Renders each number of samples into `directory`. Throws previz::Error
// with what failed; Blender's own words are in DIRECTORY/blender.log.
std::vector<CyclesRender> render_with_cycles(const CyclesOptions& options,
                                             const std::vector<int>& samples, std::uint32_t seed,
                                             const std::filesystem::path& directory);

// Reads the composite that a user makes: Combined over the plate times the Shadow Catcher pass,
// which is the ratio of the catcher's light with and without the virtual objects. As layers, the
// mask is Combined's alpha, the difference is plate (ratio - 1), mixed is that composite, and real
// is the plate; composite and picture are left empty. Throws previz::Error
// naming the file.
truth::EstimatedFrame read_shadow_catcher(const std::filesystem::path& file,
                                          const truth::TruthFrame& plate);

}  // namespace previz::bench
