// Timecode of takes (SMPTE ST 12-1): hours, minutes, seconds and frames.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace previz::session {

struct Timecode {
  std::string first;  // of the first observer frame: "14:03:27:12"; with ";" frames are dropped
  double fps = 25;

  friend bool operator==(const Timecode&, const Timecode&) = default;
};

struct TimecodeDigits {
  int hours = 0, minutes = 0, seconds = 0, frames = 0;
  double fps = 0;
  bool drops = false;  // the numbers of two frames are left out each minute but each tenth
};

// Returns the timecode that many frames after the first; it begins again after 24 hours. Nothing if
// `first` is no timecode of that rate.
std::optional<TimecodeDigits> timecode_after(const Timecode& timecode, std::int64_t frames);

// The times of a take as editors count them.
struct TakeClock {
  double fps = 0;  // 0: not known
  std::optional<Timecode> timecode;
  std::int64_t first_ns = 0;  // when the first observer frame was taken

  // Returns the timecode of the frame that was taken then. Frames that are missing before it count.
  std::optional<TimecodeDigits> at(std::int64_t timestamp_ns) const;
};

// Whether the timecode counts each of the take's frames: a rig may count 25 a second and film 30.
bool counts_frames(const TakeClock& clock);

// "14:03:27:12", or "14:03:27;12" where numbers are dropped.
std::string words_of(const TimecodeDigits& digits);

}  // namespace previz::session
