// The checksum by which a session's lines name the packets of its videos.
#pragma once

#include <cstdint>
#include <span>

namespace previz::session {

// Returns the CRC-32 (IEEE 802.3, as zlib's) of what has the CRC-32 `of_before`, continued by these
// bytes.
std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t of_before = 0);

}  // namespace previz::session
