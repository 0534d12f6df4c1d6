// The pixel formats of GenICam (PFNC) that can be converted.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/convert/convert.hpp"

namespace previz::aravis {

// `pfnc` as the camera gives it, e.g. 0x01080009 for BayerRG8. None where there is no conversion.
std::optional<convert::WireFormat> wire_format(std::uint32_t pfnc);

// Their names, for errors: "Mono8, Mono10, ...".
std::string known_formats();

}  // namespace previz::aravis
