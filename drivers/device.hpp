// What a device may say besides its data: that it is in trouble, or that its stream is over.
#pragma once

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

}  // namespace previz
