// Finds the packets of a session's video one by one, in a Matroska file whose head is torn. Not for
// use outside this room.
#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "daemon/core/session/files.hpp"

namespace previz::session {

// Where a packet lies in its file.
struct PacketPlace {
  std::int64_t video_ms = 0;  // Matroska time, in the milliseconds that VideoWriter counts
  std::uint32_t crc32 = 0;    // of the packet's bytes
  std::uint64_t offset = 0;   // of its first byte in the file
  std::size_t bytes = 0;
};

// Time and CRC-32 of the packets that are looked for.
using WantedPackets = std::set<std::pair<std::int64_t, std::uint32_t>>;

// Looks for Matroska clusters by their id (RFC 9559, section 5.1.3) from the first byte to the
// last, and returns the wanted packets in their blocks, in file order, each once. Neither the head
// of the file nor sizes in it are trusted: a packet counts only if its time and CRC-32 are wanted,
// and none of more than `most_bytes` is read. The time it takes grows
// with the size of the file, whatever is in it, and the memory with the number of wanted packets.
// Places that the disk cannot read are passed over. A stop ends it with previz::Error, as a file
// that cannot be opened does.
std::vector<PacketPlace> find_packets(const std::filesystem::path& file, WantedPackets wanted,
                                      std::size_t most_bytes, const std::stop_token& stop = {});

// Fills `bytes` from the file; returns false if the file ends before, or cannot be read there.
bool read_at(const OpenFile& file, std::uint64_t offset, std::span<std::uint8_t> bytes);

}  // namespace previz::session
