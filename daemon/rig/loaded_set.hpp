// A set with everything that its files can be wrong about already read: all of it or nothing.
#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"

namespace previz::rig {

struct LoadedSet {
  set::Set set;
  std::string text;                         // of the file, as it goes into takes
  std::filesystem::file_time_type changed;  // the file, before it was read
  scene::Scene scene;
};

// Tells once that a set file has changed: when two looks one after the other find the same new
// time, because until then it may still be being written.
class SetFileWatch {
 public:
  using Time = std::filesystem::file_time_type;
  explicit SetFileWatch(Time known) : known_(known), seen_(known) {}
  bool is_changed(Time time) {
    if (std::exchange(seen_, time) != time || time == known_) return false;
    known_ = time;
    return true;
  }

 private:
  Time known_, seen_;
};

// Throws previz::Error with every problem of the set, or of its scene.
LoadedSet load_whole_set(const std::filesystem::path& file);

// The set file `next` places after `file` in its folder, by name and around the end; files are
// those that end in .toml.
std::filesystem::path neighbour(const std::filesystem::path& file, int next);

}  // namespace previz::rig
