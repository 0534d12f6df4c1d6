#include "drivers/device.hpp"

namespace previz {

const char* to_string(DeviceState state) {
  switch (state) {
    case DeviceState::absent:
      return "absent";
    case DeviceState::starting:
      return "starting";
    case DeviceState::streaming:
      return "streaming";
    case DeviceState::stalled:
      return "stalled";
    case DeviceState::lost:
      return "lost";
  }
  return "?";
}

}  // namespace previz
