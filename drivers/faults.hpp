// Faults put into any camera's stream by a plan: to rehearse, and to test, what happens then.
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

// Opens a device, each time anew; throws previz::Error while it cannot be opened.
using CameraOpener = std::function<std::unique_ptr<Camera>()>;

// What goes wrong at the frame'th frame (from 0) that the device delivers, over all its openings.
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

// "drop@30", "drop@30+5", "corrupt@7", "late@12+3", "stall@60", "disconnect@90+1.5s".
// Throws previz::Error that quotes the text and says what is allowed.
Fault parse_fault(const std::string& text);

// A device whose cable can be pulled. The cameras it opens may outlive it. open() belongs to one
// thread; unplug() and plug() may be called from any.
class FaultyDevice {
 public:
  FaultyDevice(CameraOpener open, std::vector<Fault> plan, HostClock clock = {});

  // Throws previz::Error while the device is unplugged, and what the opener throws.
  std::unique_ptr<Camera> open();

  void unplug();  // the open camera is lost, at its next next()
  void plug();

  struct State;

 private:
  CameraOpener open_;
  std::shared_ptr<State> state_;
};

// The same as an opener.
CameraOpener with_faults(CameraOpener open, std::vector<Fault> plan, HostClock clock = {});

}  // namespace previz
