// The recorder's part of `previzd check`: what the recordings of a set ask of this computer's disks
// and memory, as these are now.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/check.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::output {

// What a set's cameras are expected to deliver, from its settings or from the sessions that are
// replayed. The pictures' bytes are estimated by the name of their format: 2 a pixel if none is
// given.
struct ExpectedFrames {
  double bytes_a_second = 0;  // of those cameras whose rate and size are known
  // Tables of the set that say too little of a live camera: "[observer.camera]".
  std::vector<std::string> unknown;
};
ExpectedFrames expected_frames(const set::Set& set);

// Returns why no take can be recorded whatever the cameras do, as errors of the set: a folder of
// takes that is a file, or lies in one.
std::vector<std::string> why_nothing_is_recorded(const set::Set& set);

// Returns a line for each thing that the crew should know before the first take: folders that
// cannot be written, both on one disk, disks that are almost full or hold only some minutes, and
// memory too small for the time before the button. `memory_bytes` is the computer's.
std::vector<std::string> remarks_on_recording(const set::Set& set, std::uint64_t memory_bytes);

// Does both for `previzd check`. A take says how it was recorded, and nothing more is recorded by
// its set.
void check(const set::CheckedSet& checked, set::Findings& findings);

// Prints where takes go, how much is free there and for how long it lasts.
void describe(const set::Set& set, std::ostream& out);

}  // namespace previz::output
