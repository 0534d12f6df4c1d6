// Finds an Aravis camera and settles with it what it will send.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/aravis/protocol.hpp"
#include "drivers/aravis/receiver/gobject.hpp"
#include "drivers/camera_settings.hpp"
#include "drivers/exposure_ledger.hpp"

namespace previz::aravis {

// The settings that the camera and the receiver have agreed on.
struct Agreed {
  std::uint32_t pfnc = 0;  // PFNC code of the wire format
  int width = 0, height = 0;
  double rate_hz = 0;        // 0: unknown
  std::int64_t payload = 0;  // bytes of a buffer, as the camera says
  Exposure exposure;
  bool drives_exposure = false;
  bool gain_in_db = false;
  bool chunks = false;  // frames carry their exposure
};

// Searches the network or the USB, as this process may.
std::vector<Listed> list_devices();

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

void configure_gige_stream(ArvStream& stream, std::int64_t payload);

}  // namespace previz::aravis
