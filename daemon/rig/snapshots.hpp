// Writes snapshots: the picture that was shown, as EXR with every layer and as PNG.
#pragma once

#include <filesystem>
#include <string>

#include "daemon/pipeline/shot.hpp"
#include "daemon/set/set.hpp"

namespace previz::rig {

// Writes DIR/snapshot_NNNN.exr and .png under the next free number; returns the path without
// extension. Throws previz::Error naming the file.
std::filesystem::path write_snapshot(const pipeline::Shot& shot, const set::Set& set);

}  // namespace previz::rig
