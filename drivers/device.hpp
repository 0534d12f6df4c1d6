// What a device may say besides its data, and where it is in its life.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace previz {

// The stream is over and will not come back (only replay says this).
struct EndOfStream {};

// What is wrong with a device, in words for the display: the device, what happened, what follows.
// A value in the stream, never an exception across threads.
struct DeviceTrouble {
  std::string device;
  std::string what;
  // Nothing more comes from this device until it is closed and opened again. Otherwise the stream
  // goes on, with whatever was in trouble left out.
  bool lost = false;
};

// Where a device that is kept alive is in its life.
enum class DeviceState {
  absent,     // not there, or not to be opened; tried again after a while
  starting,   // open, and nothing came of it yet
  streaming,  // frames come
  stalled,    // frames came, and come no more; about to be given up
  lost,       // closed after a failure; to be opened anew
};

const char* to_string(DeviceState state);

// Totals by what was counted: "frames cut short", "stream missing packets". They only grow, and an
// entry that is there once stays.
using DeviceCounters = std::map<std::string, std::uint64_t>;

}  // namespace previz
