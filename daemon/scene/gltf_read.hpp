// A glTF 2.0 file, text or binary, through tinygltf. Guards what tinygltf 2.7 does not: nesting
// that would overflow its stack, a binary chunk past the end of the file, files that are no regular
// files. Images stay encoded.
#pragma once

#include <tiny_gltf.h>

#include <filesystem>
#include <string>

#include "daemon/scene/load_log.hpp"

namespace previz::scene {

// Image::image holds the encoded bytes of images that are not in a buffer view; empty where the
// image's file cannot be read. Throws previz::Error naming the file; extensions that are required
// and not known are an error, those only used a note.
tinygltf::Model read_gltf(const std::filesystem::path& file, Notes& notes);

}  // namespace previz::scene
