// Translates V4L2's pixel formats to those of convert.hpp. Not for use outside the driver.
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/convert/convert.hpp"

namespace previz::v4l2 {

// Returns none if there is no conversion.
std::optional<convert::WireFormat> wire_format(std::uint32_t fourcc);

// Adds the colour coding that the driver reports, or the one that V4L2 defines as its default.
std::optional<convert::WireFormat> wire_format(const v4l2_pix_format& format);

// Returns "YUYV" or the like; the code of a big-endian variant ends in "-BE".
std::string fourcc_name(std::uint32_t fourcc);
// Returns the code of a format that can be converted; none if no such format has this name.
std::optional<std::uint32_t> fourcc_of(const std::string& name);
std::string known_formats();

}  // namespace previz::v4l2
