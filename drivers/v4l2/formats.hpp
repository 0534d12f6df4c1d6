// V4L2's pixel formats as convert.hpp knows them. Not for use outside the driver.
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <optional>
#include <string>

#include "drivers/convert/convert.hpp"

namespace previz::v4l2 {

// None where there is no conversion.
std::optional<convert::WireFormat> wire_format(std::uint32_t fourcc);

// With the colour coding the driver says, or V4L2's defaults stand for.
std::optional<convert::WireFormat> wire_format(const v4l2_pix_format& format);

// "YUYV"; the code of a big-endian variant ends in "-BE".
std::string fourcc_name(std::uint32_t fourcc);
// Of the formats that can be converted. None where the name is no such format's.
std::optional<std::uint32_t> fourcc_of(const std::string& name);
std::string known_formats();

}  // namespace previz::v4l2
