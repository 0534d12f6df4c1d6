// Opens the device that draws, and remembers over restarts and boots whether it was a GPU.
#pragma once

#include <memory>
#include <string>

#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/report/reports.hpp"

namespace previz::live {

// Returns the device, open; or one that is awaited, which is not open yet, if the rig had a GPU
// that is not there now: its module may come late, or it is being reset. A CPU device is taken if
// `cpu_instead`, or if the rig never had a GPU. The memory is the file "graphics-device" in the
// folder that systemd names by STATE_DIRECTORY; without such a folder, or if `options` names a
// device, nothing is remembered. If there is no device at all, a service awaits one, because takes
// can be recorded without; elsewhere previz::Error is thrown.
std::shared_ptr<render::Device> open_graphics(const render::DeviceOptions& options,
                                              bool cpu_instead, report::Reports& reports);

// Lets whatever else runs go before the drawing of a device that is the processor: above all the
// recording, which then keeps up with the cameras while pictures become fewer. Of no effect on a
// GPU.
void let_recording_first();

// Returns the device's name for the log.
std::string device_words(const render::Device& device);

}  // namespace previz::live
