// The cameras that must pass the compliance suite: a new driver is one folder and one line here.
#include <array>

#include "tests/devices/device_under_test.hpp"
#include "tests/devices/devices.hpp"

namespace previz::test {

std::span<const RegisteredDevice> registered_devices() {
  static constexpr auto devices = std::to_array<RegisteredDevice>({
      {"replay", false, true, make_replay},
      {"replay_at_four_times_the_speed", false, true, make_fast_replay},
      {"replay_as_fast_as_consumed", false, true, make_unpaced_replay},
#ifdef PREVIZ_WITH_ARAVIS
      {"aravis", true, true, make_aravis},
      {"aravis_triggered_by_software", true, false, make_triggered_aravis},
      {"aravis_losing_a_tenth_of_its_packets", true, false, make_lossy_aravis},
#endif
#ifdef PREVIZ_WITH_LIBCAMERA
      {"libcamera", true, true, make_libcamera},
#endif
#ifdef PREVIZ_WITH_V4L2
      {"v4l2", true, true, make_v4l2},
#endif
  });
  return devices;
}

}  // namespace previz::test
