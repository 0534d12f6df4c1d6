// Lists the passes that pictures are made by.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"

namespace previz::render {

// Returns what a shown picture with these features (FEATURE_* bits) is made by on a device with
// these DEVICE_* bits, and then what averages it. What bends meshes is not among them: it has one
// pipeline for all pictures.
std::vector<Pass> passes_for(std::uint32_t features, std::uint32_t device);

}  // namespace previz::render
