// Changes values in the text of a set file and leaves everything else of it as it is: comments,
// order, spaces. Beside that it keeps the old file.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace previz::set {

class FileEdit {
 public:
  // Throws previz::Error if `text` is not TOML.
  explicit FileEdit(std::string text);

  // Returns the number of the file's [[tables]] of this name. A [table] counts as one; that in
  // another is named as its header has it, "observer.intrinsics".
  std::size_t count(const std::string& tables) const;

  // These concern the table number `index` (from 0) of the file's [[tables]] of this name. They
  // throw previz::Error if there is no such table, or if it is written in braces, {...}.
  bool has(const std::string& tables, std::size_t index, const std::string& key) const;
  // Returns a key's value as the file writes it; nothing if the table lacks the key.
  std::optional<std::string> written(const std::string& tables, std::size_t index,
                                     const std::string& key) const;
  // Returns the table's keys.
  std::vector<std::string> keys(const std::string& tables, std::size_t index) const;
  // Gives a key this value, written as TOML. A new key comes after the table's last one.
  void put(const std::string& tables, std::size_t index, const std::string& key,
           const std::string& value);

  // Takes a key with its line, or lines, out of the table.
  void remove(const std::string& tables, std::size_t index, const std::string& key);

  // Adds a table, with its header, at the end of the file.
  void append(const std::string& table) { appended_ += "\n" + table; }

  // Returns the text with all changes. Throws previz::Error if that is not TOML.
  std::string text() const;

 private:
  struct Span {
    std::size_t begin = 0, end = 0;  // bytes of text_
  };
  struct Table {
    bool is_inline = false;
    std::size_t new_keys = 0;  // where they go: behind the table's last value
    std::map<std::string, Span> values;
  };
  const Table& table(const std::string& tables, std::size_t index) const;

  std::string text_, appended_;
  std::map<std::string, std::vector<Table>> tables_;
  struct Replacement {
    Span span;
    std::string by;
  };
  std::vector<Replacement> replacements_;
};

// Returns a set file's text with the keys of `table`, the text of a [name] with its header. Keys
// that the file's own table has beside them stay, or go with `whole`. Throws previz::Error as
// FileEdit does.
std::string with_table(const std::string& text, const std::string& name, const std::string& table,
                       bool whole = false);

// Returns the text of a set file. Throws previz::Error that names it where it cannot be read, and
// where it is no file: a pipe can be read only once, and one that nobody writes to, never.
std::string read_set_file(const std::filesystem::path& file);

// Copies a file beside itself, as NAME.1.old or the next number that is free, and returns the copy.
// Throws previz::Error naming the file that cannot be read or written.
std::filesystem::path keep_beside(const std::filesystem::path& file);

}  // namespace previz::set
