// Gathers the problems of one file while it is read, and reports them together in the order of its
// lines.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/keys/value.hpp"

namespace previz::set {

using previz::one_line;
using previz::printable;

class Problems {
 public:
  explicit Problems(std::string file) : file_(std::move(file)) {}

  // Lines after number `lines` belong to `file`, and are numbered from its first line.
  void go_on_with(std::string file, std::uint32_t lines);

  // `key` is the full path of the key or table at fault, "observer.lens.f_number"; `what` says what
  // is wrong and what is allowed.
  void add(Position at, const std::string& key, const std::string& what);

  // Throws previz::Error, one problem a line, "file:line:column: key: what"; returns if there are
  // none. No line of a file can break a message in two: control characters are escaped.
  void throw_if_any() const;

 private:
  struct Problem {
    Position at;
    std::string key, what;
  };
  std::string file_, next_file_;
  std::optional<std::uint32_t> lines_;  // of file_; absent: all
  std::vector<Problem> problems_;
};

// Returns the word of `known` that `word` was most likely meant to be, or "" if none is similar.
std::string nearest(const std::string& word, const std::vector<std::string>& known);

}  // namespace previz::set
