// Keeps the set that runs, the one that is to run next and the one to go back to, so that a faulty
// set never replaces a running one, and what buttons have changed since the set was written. Sets
// are read on a thread of their own, because a large scene takes long.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <utility>

#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/report/reports.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::rig {

// A set whose files, the scene's included, have been read, so that none of them can still be wrong.
struct LoadedSet {
  set::Set set;
  std::string text;                         // text of the file, as it goes into takes
  std::filesystem::file_time_type changed;  // time of the file, taken before it was read
  scene::Scene scene;
};

// Notices once that a set file has changed: when two successive looks find the same new time,
// because before that the file may still be being written.
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

// Reads a set with its scene. Throws previz::Error with every problem of the set or of the scene.
// The file `with` (set::Overlay) replaces settings of the set; it is read anew each time.
LoadedSet load_whole_set(const std::filesystem::path& file,
                         const std::optional<std::filesystem::path>& with = {});

// Returns the set file `next` places after `file` among the .toml files of its folder, by name and
// wrapping around.
std::filesystem::path neighbour(const std::filesystem::path& file, int next);

class SetKeeper {
 public:
  // Reads the first set; throws previz::Error with all its problems. `override_set` is applied to
  // every set that is to run, and so is the file `with`. `reports` outlives the keeper. What is
  // begun and has not ended after `patience` is given up, because a disk does not answer.
  SetKeeper(const std::filesystem::path& file, std::function<void(set::Set&)> override_set,
            report::Reports& reports, std::optional<std::filesystem::path> with = {},
            std::chrono::milliseconds patience = std::chrono::seconds(30));
  ~SetKeeper();

  const LoadedSet& running() const { return running_; }
  bool has_next() const { return next_.has_value(); }
  // Returns in one line why what was asked for last is not the running set; "" if it is.
  const std::string& problem() const { return problem_; }

  // Begins to read the set file `next` places on in the folder; with 0, the running one again.
  void begin_change(int next);
  // Begins to read the running set's file again if it has changed. Call it once a second. Waits for
  // no disk, nor does anything below: returns whether a look, which an earlier call may have begun,
  // has ended.
  bool look_at_file();
  // Begins to write the changes into the running set's file; the old file is kept beside it. The
  // next set is then what was written, and its run begins without changes. They are not written if
  // the file was changed meanwhile, would not load or cannot be written; it is then as it was.
  void begin_keep(const pipeline::Edits& edits);

  // Nothing may be begun while something is being read.
  bool is_reading() const { return reading_.valid(); }
  // Waits at most so long for what was begun. Returns nothing while it goes on. Once it has ended,
  // has_next() is true, or `why_not` is the reason in one line, which was reported in full.
  struct Ended {
    std::optional<std::string> why_not;
  };
  std::optional<Ended> finish(std::chrono::milliseconds patience);
  // Drops the next set and reports why. If it is the running one, changed, it is read again later.
  std::string drop_next(const std::string& why);

  // The changes to begin the running set with: those with which its last run ended (leave()), if it
  // was the same file. Changes of what the file no longer has are dropped and reported.
  const pipeline::Edits& edits() const { return changes_.edits; }
  void leave(pipeline::Edits edits) { changes_.edits = std::move(edits); }

  // Makes the next set the running one; has_next() must hold.
  void begin_next();
  // Puts the previous set in place of the running one, which could not be started. Returns false if
  // there is none.
  bool go_back(const std::string& why);

 private:
  // What keep() wrote into the running set's file.
  struct Kept {
    std::string text_before;
    pipeline::Edits edits;
  };
  // Those to the running set.
  struct Changes {
    pipeline::Edits edits;
    std::optional<Kept> kept;
  };

  // A set that was read, and what is to be done with it.
  struct Read {
    LoadedSet set;
    std::optional<Kept> kept;  // what was written
    std::string kept_beside;   // the old file
  };

  void begin(std::function<Read()> read, std::function<std::string(const std::string&)> refused);
  void run(LoadedSet set);
  void carry_edits();

  const std::function<void(set::Set&)> override_set_;
  const std::optional<std::filesystem::path> with_;
  const std::chrono::milliseconds patience_;
  report::Reports& reports_;
  LoadedSet running_;
  SetFileWatch file_;
  std::optional<LoadedSet> next_, before_;
  std::string problem_;
  Changes changes_, changes_before_;
  std::function<std::string(const std::string&)> refused_;  // reports why a reading has failed
  using Clock = std::chrono::steady_clock;
  Clock::time_point begun_{};
  std::future<Read> reading_;  // its thread uses nothing of this, nor does that of the next
  std::future<std::optional<SetFileWatch::Time>> looked_;
  std::filesystem::path looked_for_;
};

}  // namespace previz::rig
