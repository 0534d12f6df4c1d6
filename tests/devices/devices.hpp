// The devices of the registry, each in its own file.
#pragma once

#include <memory>
#include <string>

#include "tests/devices/device_under_test.hpp"

namespace previz::test {

std::unique_ptr<DeviceUnderTest> make_replay(std::string& why_not);
std::unique_ptr<DeviceUnderTest> make_unpaced_replay(std::string& why_not);
std::unique_ptr<DeviceUnderTest> make_aravis(std::string& why_not);
std::unique_ptr<DeviceUnderTest> make_lossy_aravis(std::string& why_not);
std::unique_ptr<DeviceUnderTest> make_triggered_aravis(std::string& why_not);
std::unique_ptr<DeviceUnderTest> make_v4l2_stand_in(std::string& why_not);
// The camera that the variable PREVIZ_TEST_DRIVER names (PREVIZ_TEST_V4L2), or the first one that
// the driver finds.
std::unique_ptr<DeviceUnderTest> make_found(const std::string& driver, std::string& why_not);

}  // namespace previz::test
