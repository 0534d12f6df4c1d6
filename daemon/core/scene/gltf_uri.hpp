// Reads the URIs of a glTF file's buffers and images in place of tinygltf, which knows six types of
// data URIs only, and takes a + in a file's name for a space.
#pragma once

#include <tiny_gltf.h>

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/scene/gltf_json.hpp"
#include "daemon/core/scene/load_log.hpp"
#include "daemon/core/scene/named_file.hpp"

namespace previz::scene {

bool is_data_uri(const std::string& uri);

// Returns the bytes of a data URI of whatever type, in base64 or percent-encoded (RFC 2397). Throws
// previz::Error beginning with `where` if there are none to be read.
std::vector<unsigned char> data_of(const std::string& uri, const std::string& where);

// Writes the URIs of buffers in the way that tinygltf reads right. Throws previz::Error naming
// buffer and file where that file is missing. A file of another name is noted.
void mend_buffer_uris(GltfJson& json, const std::filesystem::path& file, NameRules rules,
                      Notes& notes);

// Takes the URIs of images out of the JSON and returns them by the number of the image; "" where it
// has none. put_back() gives them to the model that tinygltf has made of the JSON.
std::vector<std::string> take_out_image_uris(GltfJson& json);
void put_back(std::vector<std::string> image_uris, tinygltf::Model& model);

}  // namespace previz::scene
