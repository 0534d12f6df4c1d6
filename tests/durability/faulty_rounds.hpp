// Rounds of the same work on a FaultyDisk: by each power cut, and by each call that fails.
#pragma once

#include "tests/durability/faulty_disk.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

// Looks at the folder, restored to `target`, as a power cut before each call from `first` on may
// leave it.
inline void for_each_power_cut(const FaultyDisk& disk, std::size_t first,
                               const std::filesystem::path& target,
                               const std::function<void(std::size_t cut)>& look) {
  for (std::size_t cut = first; cut <= disk.calls(); ++cut)
    for (const AfterPowerCut kept : power_cuts) {
      SCOPED_TRACE("cut before call " + std::to_string(cut) + " (" + disk.describe(cut) +
                   "), kept " + std::to_string(static_cast<int>(kept)));
      disk.restore(cut, kept, target);
      look(cut);
    }
}

// Cases that are run once for each kind of fault, which is their parameter.
class EveryFault : public testing::TestWithParam<DiskFault> {
 protected:
  // A round of work on a disk of its own.
  struct Round {
    const TemporaryDirectory folder;
    FaultyDisk disk{folder.path()};
    std::size_t call = 0;  // that fails
    bool has_failed() const { return call < disk.calls(); }
    std::string describe() const {
      return "call " + std::to_string(call) + ", " + disk.describe(call);
    }
  };

  // Does the work with each of its calls in turn failing, counted from those of `before`, and once
  // more with none.
  void for_each_call(
      const std::function<void(Round&)>& work,
      const std::function<void(const Round&)>& before = [](const Round&) {}) const {
    bool has_failed = true;
    for (std::size_t call = 0; has_failed; ++call) {
      Round round;
      before(round);
      round.call = round.disk.calls() + call;
      round.disk.fail(round.call, GetParam());
      work(round);
      has_failed = round.has_failed();
    }
  }
};

}  // namespace previz::test
