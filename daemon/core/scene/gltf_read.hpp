// Reads a glTF 2.0 file, text or binary, with tinygltf. It guards against what tinygltf 2.7 lets
// through: a binary chunk past the end of the file, paths that are not regular files, and what
// daemon/core/scene/gltf_json.hpp checks. Images stay encoded.
#pragma once

#include <tiny_gltf.h>

#include <filesystem>
#include <string>

#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/named_file.hpp"

namespace previz::scene {

// Images are not read: encoded_image() (daemon/core/scene/gltf_texture.hpp) does that, of a buffer
// view or of Image::uri, as the file has it. The rules are for the names of buffers' files. Throws
// previz::Error naming the file. An unknown extension is an
// error if it is required and a note if it is only used.
tinygltf::Model read_gltf(const std::filesystem::path& file, Notes& notes,
                          NameRules rules = names_in_objects);

}  // namespace previz::scene
