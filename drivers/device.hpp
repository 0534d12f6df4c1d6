// What a device reports besides its data, and the states that it goes through.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace previz {

// The stream is over and will not come back (only replay reports this).
struct EndOfStream {};

// Trouble with a device, in words for the display: the device, what happened, what follows. It is a
// value in the stream, never an exception across threads.
struct DeviceTrouble {
  std::string device;
  std::string what;
  // True: nothing more comes from this device until it is closed and opened again. False: the
  // stream goes on without the data that was in trouble.
  bool lost = false;
};

// The state of a device that a lifeline keeps alive.
enum class DeviceState {
  absent,     // not there, or cannot be opened; tried again after a while
  starting,   // open, but nothing has come of it yet
  streaming,  // frames come
  stalled,    // frames came, but have stopped; about to be given up
  lost,       // closed after a failure; will be reopened
};

const char* to_string(DeviceState state);

// Totals by what they count: "frames cut short", "stream missing packets". They only grow, and no
// entry is ever removed.
using DeviceCounters = std::map<std::string, std::uint64_t>;

}  // namespace previz
