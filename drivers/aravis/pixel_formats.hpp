// Lists the pixel formats of GenICam (PFNC) that can be converted.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/convert/convert.hpp"

namespace previz::aravis {

// Returns the format of a PFNC code, e.g. 0x01080009 for BayerRG8; none if there is no conversion.
std::optional<convert::WireFormat> wire_format(std::uint32_t pfnc);

// Returns the names of all these formats, for errors: "Mono8, Mono10, ...".
std::string known_formats();

}  // namespace previz::aravis
