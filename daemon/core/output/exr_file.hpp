// Writes OpenEXR files as the other files of this program are written: whole or not at all.
#pragma once

#include <ImathBox.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>

#include <cstddef>
#include <filesystem>

#include "daemon/core/session/draft.hpp"

namespace previz::output {

// Returns the place of a channel of 32-bit floats in rows of `width` pixels. `first` is that of the
// first pixel, and `floats_a_pixel` floats lie between those of two pixels. The floats are also
// written to if a file is read into the slice.
Imf::Slice exr_slice(const float* first, std::size_t floats_a_pixel, int width);

// Writes the channels into a draft, which is not yet put in place. Throws previz::Error naming the
// file on failure.
session::Draft exr_draft(const std::filesystem::path& path, const Imf::Header& header,
                         const Imf::FrameBuffer& channels);

// Throws previz::Error naming the file unless it is a flat OpenEXR file of one part whose header
// can be read and claims no more pixels than an environment may have
// (lighting::check_exr_header()).
void require_exr(const std::filesystem::path& path);

// Returns the number of pixels of a data window. Throws previz::Error naming the file unless the
// window begins at 0, 0 and has from 1 to most_pixels pixels.
std::size_t exr_pixels(const std::filesystem::path& path, const Imath::Box2i& window);

// Reads the whole file into these channels. Throws previz::Error naming the file and a channel that
// it does not have, or what OpenEXR throws.
void read_channels(const std::filesystem::path& path, Imf::InputFile& file,
                   const Imf::FrameBuffer& channels);

}  // namespace previz::output
