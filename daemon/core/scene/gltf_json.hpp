// Looks at the JSON of a glTF file before tinygltf reads it, which cuts off, wraps round or skips
// what it does not expect.
#pragma once

#include <string>
#include <string_view>

#include "daemon/core/scene/gltf_text.hpp"

namespace previz::scene {

// Parses the JSON. It is of glTF 2.0, requires no extension that is refused
// (daemon/core/scene/gltf_extensions.hpp), and every number of it that is an index, an offset, a
// count or a code is a whole number that tinygltf can hold; 3.0 has become 3. Throws previz::Error
// beginning with `file` and naming the place in the JSON otherwise.
GltfJson checked_json(std::string_view text, const std::string& file);

// Throws that a file is of another version of glTF than 2, and what can be done about it.
[[noreturn]] void refuse_version(const std::string& version, const std::string& file);

}  // namespace previz::scene
