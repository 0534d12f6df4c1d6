// The cameras that must pass the compliance suite: those with a file of their own here, and of
// every other driver a camera that is really there.
#include <algorithm>
#include <vector>

#include "drivers/camera_drivers.hpp"
#include "tests/devices/device_under_test.hpp"
#include "tests/devices/devices.hpp"

namespace previz::test {

std::span<const RegisteredDevice> registered_devices() {
  static const std::vector<RegisteredDevice> devices = [] {
    std::vector<RegisteredDevice> all{
        {"replay", false, true, make_replay},
        {"replay_as_fast_as_consumed", false, true, make_unpaced_replay},
#ifdef PREVIZ_WITH_V4L2
        {"v4l2_on_a_stand_in", true, true, make_v4l2_stand_in},
#endif
#ifdef PREVIZ_WITH_ARAVIS
        {"aravis", true, true, make_aravis},
        {"aravis_triggered_by_software", true, false, make_triggered_aravis},
        {"aravis_losing_a_tenth_of_its_packets", true, false, make_lossy_aravis},
#endif
    };
    for (const CameraDriver& driver : camera_drivers()) {
      const std::string name = driver.name;
      if (std::ranges::none_of(all, [&](const RegisteredDevice& own) { return own.name == name; }))
        all.push_back({driver.name, true, true,
                       [name](std::string& why_not) { return make_found(name, why_not); }});
    }
    return all;
  }();
  return devices;
}

}  // namespace previz::test
