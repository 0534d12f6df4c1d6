// Reads a glTF 2.0 file, text or binary, with tinygltf. It guards against what tinygltf 2.7 lets
// through: a binary chunk past the end of the file, paths that are not regular files, and what
// daemon/scene/gltf_json.hpp checks. Images stay encoded.
#pragma once

#include <tiny_gltf.h>

#include <filesystem>
#include <string>

#include "daemon/scene/load_log.hpp"

namespace previz::scene {

// Image::image holds the encoded bytes of images that are not in a buffer view; it is empty if the
// image's file cannot be read. Throws previz::Error naming the file. An unknown extension is an
// error if it is required and a note if it is only used.
tinygltf::Model read_gltf(const std::filesystem::path& file, Notes& notes);

}  // namespace previz::scene
