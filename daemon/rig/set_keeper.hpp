// Which set runs, which one is to run next, and which one to go back to: a set with a fault never
// takes the place of one that runs.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "daemon/report/reports.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"

namespace previz::rig {

// A set and everything that its files can be wrong about, already read.
struct LoadedSet {
  set::Set set;
  std::string text;                         // of the file, as it goes into takes
  std::filesystem::file_time_type changed;  // of the file, before it was read
  scene::Scene scene;
};

// Notices once that a set file has changed: when two looks one after the other find the same new
// time, because until then the file may still be being written.
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

class SetKeeper {
 public:
  // Reads the first set; throws previz::Error with every problem of it. `override_set` is applied
  // to every set that is to run. `reports` outlives the keeper.
  SetKeeper(const std::filesystem::path& file, std::function<void(set::Set&)> override_set,
            report::Reports& reports);

  const LoadedSet& running() const { return running_; }
  bool has_next() const { return next_.has_value(); }

  // Reads the set file `next` places on in the folder; 0: the running one again. Either has_next()
  // is true afterwards, or the reason why not is returned, in one line, and reported in full.
  std::optional<std::string> change(int next);
  // Looks at the running set's file, and reads it again where it has changed; once a second.
  void look_at_file();

  // The next set is the running one from now on; has_next() must hold.
  void begin_next();
  // The running set could not be started: the one before it takes its place. False: there is none.
  bool go_back(const std::string& why);

 private:
  void run(LoadedSet set);

  const std::function<void(set::Set&)> override_set_;
  report::Reports& reports_;
  LoadedSet running_;
  SetFileWatch file_;
  std::optional<LoadedSet> next_, before_;
};

}  // namespace previz::rig
