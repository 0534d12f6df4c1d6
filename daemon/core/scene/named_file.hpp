// Finds and reads the files that a scene or a scan names, as other programs and computers write
// names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace previz::scene {

struct NameRules {
  bool may_lead_up = false;  // "../maps/a.png" is followed; absolute paths never are
  bool is_uri = false;       // "a%20b.png" means "a b.png", and only then itself
};
inline constexpr NameRules names_in_objects{.may_lead_up = true, .is_uri = true};
inline constexpr NameRules names_in_scans{};

struct NamedFile {
  std::filesystem::path path;
  bool has_other_name = false;  // found beside the scene, or by letters of another case
};

// Finds the regular file that the scene or scan `file` calls `name`: as written, with %20 and the
// like decoded, and with \ as /; then by its bare name beside `file`, where the path is another
// computer's; then by letters A to Z of another case, if one file alone has such a name; and last,
// of a URI, without what follows ? or #. Returns nothing if there is none.
std::optional<NamedFile> find_named_file(const std::filesystem::path& file, const std::string& name,
                                         NameRules rules);

// Returns what the crew has to know of a file that has another name: `texture "RED.PNG": is read
// from red.png`; "" where it has its own. `what` is "texture" or the like.
std::string note_of_other_name(const NamedFile& found, const std::string& what,
                               const std::string& name);

// Returns text with %20 and the like decoded (RFC 3986, 2.1); a % that begins no such code stays.
std::string without_escapes(const std::string& text);

// Reads a regular file of at most max_file_bytes; returns what is wrong, or "".
std::string read_regular_file(const std::filesystem::path& file, std::vector<unsigned char>& bytes);

}  // namespace previz::scene
