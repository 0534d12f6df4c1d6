// Puts planned faults into any camera's stream, to rehearse and to test what happens then.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "drivers/camera.hpp"
#include "drivers/host_clock.hpp"

namespace previz {

// Opens a device anew at each call; throws previz::Error while it cannot be opened.
using CameraOpener = std::function<std::unique_ptr<Camera>()>;

// Says what goes wrong at frame number `frame`, counted from 0 over all openings of the device.
struct Fault {
  enum class Kind {
    drop,        // `frames` frames never come; their sequence numbers are missing
    corrupt,     // `frames` frames come damaged: trouble in their place
    late,        // this and the next `frames` frames come all at once, when the last of them is due
    stall,       // nothing more comes until the camera is stopped and started
    disconnect,  // the device is lost, and cannot be opened for `absent`
  };
  Kind kind = Kind::drop;
  std::uint64_t frame = 0;
  std::uint64_t frames = 1;
  std::chrono::nanoseconds absent{0};

  friend bool operator==(const Fault&, const Fault&) = default;
};

// Parses "drop@30", "drop@30+5", "corrupt@7", "late@12+3", "stall@60" or "disconnect@90+1.5s".
// Throws previz::Error that quotes the text and says what is allowed.
Fault parse_fault(const std::string& text);

// A device whose cable can be pulled. The cameras it opens may outlive it. open() belongs to one
// thread; unplug() and plug() may be called from any.
class FaultyDevice {
 public:
  FaultyDevice(CameraOpener open, std::vector<Fault> plan, HostClock clock = {});

  // Throws previz::Error while the device is unplugged, and what the opener throws.
  std::unique_ptr<Camera> open();

  void unplug();  // the open camera is lost at the next call of its next()
  void plug();

  struct State;

 private:
  CameraOpener open_;
  std::shared_ptr<State> state_;
};

// Returns an opener for a FaultyDevice.
CameraOpener with_faults(CameraOpener open, std::vector<Fault> plan, HostClock clock = {});

}  // namespace previz
