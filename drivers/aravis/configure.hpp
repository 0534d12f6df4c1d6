// Finds an Aravis camera and settles with it what it will send. Not for use outside the driver.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "drivers/aravis/gobject.hpp"
#include "drivers/camera.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/convert/convert.hpp"
#include "drivers/exposure_ledger.hpp"

namespace previz::aravis {

// The settings that the camera and the driver have agreed on.
struct Agreed {
  CameraFormat format;
  convert::WireFormat wire;
  std::uint32_t pfnc = 0;   // PFNC code of the wire format
  std::size_t payload = 0;  // bytes of a buffer
  Exposure exposure;
  bool drives_exposure = false;
  bool gain_in_db = false;
  bool software_trigger = false;
  bool chunks = false;  // frames carry their exposure
};

// Throws previz::Error that names the device.
Owned<ArvCamera> find_camera(const std::string& device);

// Writes the settings to the camera and reads back what it made of them. Throws previz::Error that
// names the device, the setting, and what the camera can.
Agreed configure(ArvCamera& camera, const CameraSettings& settings);

// Sets an exposure and returns what the camera made of it, within its bounds and in its steps.
// Throws previz::Error.
Exposure set_exposure(ArvCamera& camera, const std::string& device, const Exposure& wanted);

// Returns the name under which a counter of Aravis is published: "stream missing packets" for
// n_missing_packets.
std::string counter_name(std::string aravis_name);

void configure_gige_stream(ArvStream& stream, std::size_t payload);

}  // namespace previz::aravis
