// Copies one take with checksums, and compares a copy with them.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/core/output/take_list.hpp"

namespace previz::post {

// The file of a copy with the SHA-256 of every other, as `sha256sum` writes and reads it.
inline constexpr const char* checksums_name = "SHA256SUMS";

// Returns false if an earlier call made the same copy, which is then left as it is. Throws
// previz::Error, and leaves no copy, on a stop, if the place is taken by something else, if there
// is too little room, or if what is read back differs.
bool copy_take(const output::ListedTake& take, const std::filesystem::path& copy,
               const std::stop_token& stop);

// Returns what differs from the copy's checksums, in words; nothing if it has none.
std::vector<std::string> checksum_faults(const std::filesystem::path& copy,
                                         const std::stop_token& stop);

// Brings one file's line of the checksums up to date.
void write_checksum(const std::filesystem::path& copy, const std::string& file);

}  // namespace previz::post
