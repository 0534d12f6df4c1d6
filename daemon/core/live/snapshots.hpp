// Writes snapshots: the picture that was shown, as EXR with every layer and as PNG.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::live {

// Writes DIR/snapshot_NNNN.exr and .png under the number after the last; returns the path without
// extension. Other processes may do so in the same folder. A snapshot never takes space that takes
// keep free on their disk (recording.reserve_mb). Throws previz::Error naming the file.
std::filesystem::path write_snapshot(const pipeline::Shot& shot, const set::Set& set);

// Puts an EXR under the next number in its folder, which nobody else then takes. Returns the path
// without extension; throws previz::Error.
std::filesystem::path put_snapshot(session::Draft& exr);

// Throws previz::Error if a file of so many bytes in `folder` would leave less than `reserve_bytes`
// on the disk that the takes are on; on another disk, if it does not fit.
void check_space(const std::filesystem::path& folder, std::uint64_t bytes,
                 const std::filesystem::path& takes, std::uint64_t reserve_bytes);

}  // namespace previz::live
