// Parses the JSON of a glTF file, also where an exporter has written numbers and letters into it
// that JSON does not have.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace previz::scene {

struct GltfJson {
  nlohmann::json root;             // an object
  bool is_changed = false;         // tinygltf is to read `root`, not the text of the file
  std::vector<std::string> notes;  // of what the text had that JSON does not have
};

// A place in the JSON; it is put into words, "nodes[0].name", only for a message.
struct JsonPlace {
  const JsonPlace* above;
  std::string key;        // of a member; empty: an element
  std::size_t index = 0;  // of an element
};
std::string in_words(const JsonPlace* place);

// Parses the text. Bounds of accessors and extras that are NaN or infinite are left out, and bytes
// of strings that are not UTF-8 become U+FFFD, each with a note. Throws previz::Error beginning
// with `file` and naming the place in the JSON otherwise, or the format of a file that is no glTF.
GltfJson parsed_json(std::string_view text, const std::string& file);

}  // namespace previz::scene
