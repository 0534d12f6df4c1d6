// The cameras that must pass the compliance suite: a new driver is one folder and one line here.
#include <array>

#include "tests/devices/device_under_test.hpp"
#include "tests/devices/devices.hpp"

namespace previz::test {

std::span<const RegisteredDevice> registered_devices() {
  static constexpr std::array devices{
      RegisteredDevice{"replay", false, make_replay},
      RegisteredDevice{"replay_at_four_times_the_speed", false, make_fast_replay},
      RegisteredDevice{"replay_as_fast_as_consumed", false, make_unpaced_replay},
  };
  return devices;
}

}  // namespace previz::test
