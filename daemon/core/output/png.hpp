// Writes and reads plates as PNG: RGB, with the plate's 8 or 16 bits a sample.
#pragma once

#include <filesystem>

#include "daemon/core/session/draft.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::output {

// Writes a picture without loss; the file appears whole or not at all, and without `sync` perhaps
// not at all after a power cut. Throws previz::Error naming the file.
void write_png(const std::filesystem::path& path, const Plate& picture,
               session::Sync sync = session::Sync::yes);

// Reads an RGB, RGBA or gray PNG of 8 or 16 bits; alpha is dropped, gray is repeated. Throws
// previz::Error naming the file and what is wrong with it.
Plate read_png(const std::filesystem::path& path);

}  // namespace previz::output
