// Reads YAML, JSON and XML as other programs write them into one tree of words, lists and
// maps, within limits that hostile bytes cannot pass.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace previz::calibrate {

struct Tree {
  enum class Kind { nothing, word, list, map };
  Kind kind = Kind::nothing;
  int line = 0;                   // from 1; 0 where the parser does not know it
  std::string word;               // as it is written, without quotes
  std::vector<std::string> keys;  // of a map: one for each child, none twice but by parse_whole_xml
  std::vector<Tree> children;

  // Returns the value of a map's (first such) key, or null.
  const Tree* find(std::string_view key) const;
};

// A place in a file, for messages: "cams.yaml:12: cam0.intrinsics".
struct FilePlace {
  std::string file;
  int line = 0;
  std::string key;
};

// Throws previz::Error: the place, and what is wrong there.
[[noreturn]] void fail_at(const FilePlace& place, const std::string& what);

// Each reads a whole file. Tags (!!opencv-matrix) and comments are skipped. Throw previz::Error
// with the line for a mistake in the syntax, a key that a map has twice, anchors and aliases, more
// than 32 levels, 200 000 values, or 1000 keys of one map.
struct YamlTree {
  Tree tree;              // of the first document
  bool has_more = false;  // documents
};
YamlTree parse_yaml(std::string_view text, const std::string& file);
Tree parse_json(std::string_view text, const std::string& file);
// The root element's content. An element that holds several words, or elements named "_", is a
// list.
Tree parse_xml(std::string_view text, const std::string& file);
// The root element as the only key. Attributes are keys as well, but those of an element that has
// text alone; keys may be there twice, and any number of them.
Tree parse_whole_xml(std::string_view text, const std::string& file);

}  // namespace previz::calibrate
