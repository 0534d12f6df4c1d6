#include "daemon/core/set/file_edit.hpp"

#include <fcntl.h>
#include <toml++/toml.h>
#include <algorithm>
#include <functional>

#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::set {
namespace {

toml::table parsed(const std::string& text) {
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw Error("not valid TOML: " + std::string(error.description()));
  }
}

// Returns the offset of a position, whose column counts code points.
std::size_t offset_of(const std::string& text, const toml::source_position& at) {
  std::size_t offset = 0;
  for (auto line = at.line; line > 1 && offset < text.size(); --line)
    offset = std::min(text.find('\n', offset), text.size() - 1) + 1;
  for (auto column = at.column; column > 1 && offset < text.size(); --column) {
    ++offset;
    const auto continues = [&] {
      return offset < text.size() && (static_cast<unsigned char>(text[offset]) & 0xc0) == 0x80;
    };
    while (continues()) ++offset;
  }
  return offset;
}

// Calls body(name, table) for each [table], also those in others, and for each of the [[tables]]
// that are in none.
void for_each_table(const toml::table& parent, const std::string& path,
                    const std::function<void(const std::string&, const toml::table&)>& body) {
  for (const auto& [key, node] : parent) {
    const std::string name = path + std::string(key.str());
    if (const toml::table* one = node.as_table()) {
      body(name, *one);
      for_each_table(*one, name + '.', body);
    }
    const toml::array* array = node.as_array();
    if (!array || !path.empty()) continue;
    for (const toml::node& entry : *array)
      if (const toml::table* one = entry.as_table()) body(name, *one);
  }
}

}  // namespace

FileEdit::FileEdit(std::string text) : text_(std::move(text)) {
  for_each_table(parsed(text_), "", [&](const std::string& name, const toml::table& given) {
    Table& table = tables_[name].emplace_back();
    table.is_inline = given.is_inline();
    table.new_keys =
        std::min(text_.find('\n', offset_of(text_, given.source().begin)), text_.size());
    for (const auto& [key, value] : given) {
      const toml::source_region& source = value.source();
      if (value.is_table() || (value.is_array() && value.as_array()->is_array_of_tables()))
        continue;
      const Span span{offset_of(text_, source.begin), offset_of(text_, source.end)};
      table.values[std::string(key.str())] = span;
      table.new_keys = std::max(table.new_keys, std::min(text_.find('\n', span.end), text_.size()));
    }
  });
}

const FileEdit::Table& FileEdit::table(const std::string& tables, std::size_t index) const {
  const auto found = tables_.find(tables);
  if (found == tables_.end() || index >= found->second.size())
    throw Error("no [[" + tables + "]] number " + std::to_string(index + 1));
  if (found->second[index].is_inline) {
    // Which brackets it needs is the writer's to know, who wrote none.
    const std::string which =
        found->second.size() == 1 ? tables : tables + " number " + std::to_string(index + 1);
    throw Error(which + " is an inline table, {...}; write it under a header of its own, [" +
                tables + "] or, if there can be several, [[" + tables + "]]");
  }
  return found->second[index];
}

std::size_t FileEdit::count(const std::string& tables) const {
  const auto found = tables_.find(tables);
  return found == tables_.end() ? 0 : found->second.size();
}

std::optional<std::string> FileEdit::written(const std::string& tables, std::size_t index,
                                             const std::string& key) const {
  const Table& where = table(tables, index);
  const auto known = where.values.find(key);
  if (known == where.values.end()) return std::nullopt;
  return text_.substr(known->second.begin, known->second.end - known->second.begin);
}

bool FileEdit::has(const std::string& tables, std::size_t index, const std::string& key) const {
  return table(tables, index).values.contains(key);
}

std::vector<std::string> FileEdit::keys(const std::string& tables, std::size_t index) const {
  std::vector<std::string> names;
  for (const auto& [key, span] : table(tables, index).values) names.push_back(key);
  return names;
}

void FileEdit::put(const std::string& tables, std::size_t index, const std::string& key,
                   const std::string& value) {
  const Table& where = table(tables, index);
  const auto known = where.values.find(key);
  if (known != where.values.end())
    replacements_.push_back({known->second, value});
  else
    replacements_.push_back({{where.new_keys, where.new_keys}, "\n" + key + " = " + value});
}

void FileEdit::remove(const std::string& tables, std::size_t index, const std::string& key) {
  const Table& where = table(tables, index);
  const auto known = where.values.find(key);
  if (known == where.values.end()) return;
  // With the end of the line before, so that what is added behind the last key stays apart.
  const std::size_t before = text_.rfind('\n', known->second.begin);
  replacements_.push_back({{before == std::string::npos ? 0 : before,
                            std::min(text_.find('\n', known->second.end), text_.size())},
                           ""});
}

std::string FileEdit::text() const {
  std::vector<Replacement> in_order = replacements_;
  std::ranges::stable_sort(in_order, {}, [](const Replacement& r) { return r.span.begin; });
  std::string result;
  std::size_t done = 0;
  for (const Replacement& replacement : in_order) {
    result += text_.substr(done, replacement.span.begin - done) + replacement.by;
    done = replacement.span.end;
  }
  result += text_.substr(done);
  if (!appended_.empty() && !result.empty() && result.back() != '\n') result += '\n';
  result += appended_;
  parsed(result);
  return result;
}

std::string with_table(const std::string& text, const std::string& name, const std::string& table,
                       bool whole) {
  FileEdit file(text);
  if (file.count(name) == 0) {
    file.append(table);
    return file.text();
  }
  const FileEdit given(table);
  for (const std::string& key : given.keys(name, 0))
    file.put(name, 0, key, *given.written(name, 0, key));
  for (const std::string& key : file.keys(name, 0))
    if (whole && !given.has(name, 0, key)) file.remove(name, 0, key);
  return file.text();
}

std::filesystem::path keep_beside(const std::filesystem::path& file) {
  const std::string content = read_set_file(file);
  for (int number = 1;; ++number) {
    std::filesystem::path copy = file.string() + '.' + std::to_string(number) + ".old";
    if (std::filesystem::exists(copy)) continue;
    const session::OpenFile written(copy, O_WRONLY | O_CREAT | O_EXCL);
    try {
      written.append(content);
      written.sync();
      std::filesystem::permissions(copy, std::filesystem::status(file).permissions());
    } catch (...) {  // half a copy is none
      std::error_code stays;
      std::filesystem::remove(copy, stays);
      throw;
    }
    return copy;
  }
}

}  // namespace previz::set
