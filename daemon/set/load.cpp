// Parses a set file by the table of keys: TOML goes in; typed values, or every problem, come out.
#include "daemon/set/load.hpp"

#include <toml++/toml.h>
#include <algorithm>
#include <fstream>
#include <sstream>

#include "daemon/set/file_edit.hpp"
#include "daemon/set/resolve.hpp"
#include "daemon/set/table.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/toml_value.hpp"

namespace previz::set {
namespace {

class Reader {
 public:
  Reader(Draft& draft, Problems& problems) : sections_(sections(draft)), problems_(problems) {}

  // `path` is the table's name; "" is the file itself.
  void read(const toml::table& table, const std::string& path) {
    const auto* section = find(path);
    auto opened = section ? section->open() : Section::Opened{nullptr, {}};
    if (opened.given) opened.given->at = position(table.source());

    for (const auto& [name, node] : table) {
      const std::string key(name.str());
      const auto full = path.empty() ? key : path + '.' + key;
      const auto row = std::ranges::find(opened.keys, key, &Key::name);
      if (row != opened.keys.end())
        read_key(*row, *opened.given, position(name.source()), value_of(node));
      else if (const auto* child = find(full))
        read_child(*child, position(name.source()), node);
      else
        unknown(full, key, path, position(name.source()), node.is_table(), opened.keys);
    }
    for (const auto& row : opened.keys)
      if (row.need.kind == Need::Kind::required && !opened.given->has(row.name))
        problems_.add(*opened.given->at, path + '.' + row.name,
                      "is missing; allowed: " + row.allowed + ", like " + row.need.example);
  }

 private:
  const Section* find(const std::string& path) const {
    const auto found = std::ranges::find(sections_, path, &Section::path);
    return found == sections_.end() ? nullptr : &*found;
  }

  void read_key(const Key& key, Given& given, Position at, const Value& value) {
    given.keys[key.name] = {at, false};
    try {
      key.read(value);
      given.keys[key.name].good = true;
    } catch (const Misread& misread) {
      problems_.add(misread.at, given.path + '.' + key.name, misread.what);
    }
  }

  void read_child(const Section& child, Position at, const toml::node& node) {
    const bool repeated = child.kind == Section::Kind::repeated;
    const auto header = repeated ? "[[" + child.path + "]]" : '[' + child.path + ']';
    if (const auto* table = node.as_table(); table && !repeated) return read(*table, child.path);
    if (const auto* array = node.as_array(); array && repeated) {
      for (const auto& entry : *array) {
        if (const auto* table = entry.as_table())
          read(*table, child.path);
        else
          problems_.add(position(entry.source()), child.path,
                        "has an entry that is not a table; allowed: tables, each under " + header);
      }
      return;
    }
    problems_.add(at, child.path,
                  (repeated ? "is not a list of tables" : "is not a table") +
                      std::string("; allowed: keys under ") + header);
  }

  void unknown(const std::string& full, const std::string& key, const std::string& path,
               Position at, bool is_table, const std::vector<Key>& keys) {
    std::vector<std::string> near;
    for (const auto& row : keys) near.push_back(row.name);
    const auto dot = path.empty() ? 0 : path.size() + 1;
    for (const auto& section : sections_)
      if (section.path.starts_with(path) && section.path.size() > dot &&
          section.path.find('.', dot) == std::string::npos &&
          (dot == 0 || section.path[dot - 1] == '.'))
        near.push_back(section.path.substr(dot));
    std::string hint;
    if (const auto meant = nearest(key, near); !meant.empty()) {
      hint = "did you mean " + meant + "?";
    } else if (const auto home = home_of(key); !home.empty()) {
      hint = "does it belong under " + home + "?";
    } else {
      hint = "allowed: ";
      for (const auto& word : near) hint += (&word == near.data() ? "" : ", ") + word;
    }
    problems_.add(at, full, std::string(is_table ? "unknown table; " : "unknown key; ") + hint);
  }

  // Returns the table that has such a key, or such a table inside it.
  static std::string home_of(const std::string& key) {
    Draft scratch;
    for (const auto& section : sections(scratch))
      for (const auto& row : section.open().keys)
        if (row.name == key)
          return section.kind == Section::Kind::repeated ? "[[" + section.path + "]]"
                                                         : '[' + section.path + ']';
    return "";
  }

  std::vector<Section> sections_;
  Problems& problems_;
};

}  // namespace

namespace {

// Parses TOML text; throws previz::Error if it is none.
toml::table parsed(const std::string& text, const std::string& file, Problems& problems) {
  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error& error) {
    problems.add(position(error.source()), "",
                 "not valid TOML: " + std::string(error.description()));
    problems.throw_if_any();
    throw;
  }
}

// Reads the overlay over what the draft has already. Its lines are counted on from those of the
// set, so that a position says which of the files it is in.
void read_over(Draft& draft, const Overlay& with, const std::string& text, Problems& problems) {
  const auto lines = static_cast<std::uint32_t>(std::ranges::count(text, '\n') + 1);
  problems.go_on_with(with.file.string(), lines);
  toml::table root = parsed(std::string(lines, '\n') + with.text, with.file.string(), problems);
  constexpr std::string_view allowed[] = {"quality", "estimator", "lighting"};
  std::vector<std::string> others;
  for (const auto& [name, node] : root)
    if (std::ranges::find(allowed, name.str()) == std::end(allowed)) {
      others.emplace_back(name.str());
      problems.add(position(name.source()), others.back(),
                   "belongs in the set file; allowed here: [quality], [[quality.preview]], "
                   "[estimator] and [lighting]");
    }
  for (const std::string& name : others) root.erase(name);
  if (root["quality"]["preview"]) draft.preview_steps.clear();
  Reader(draft, problems).read(root, "");
}

}  // namespace

Set parse_set(const std::string& text, const std::filesystem::path& file, const Assets& assets,
              Origin origin, const std::optional<Overlay>& with) {
  Problems problems(file.string());
  Draft draft;
  Reader(draft, problems).read(parsed(text, file.string(), problems), "");
  if (with) read_over(draft, *with, text, problems);
  auto set = resolve(std::move(draft), file, assets, origin, problems);
  problems.throw_if_any();
  return set;
}

namespace {

// Returns a file of settings. A pipe can be read only once, and one that nobody writes to, never.
std::string text_of(const std::filesystem::path& file, const char* allowed) {
  std::error_code unknown;
  const auto kind = std::filesystem::status(file, unknown).type();
  if (kind != std::filesystem::file_type::regular &&
      kind != std::filesystem::file_type::not_found && kind != std::filesystem::file_type::none)
    throw Error(file.string() +
                ": is not a file, but a folder, a pipe or a device; allowed: " + allowed);
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  if (!stream || (stream.peek() != EOF && !(text << stream.rdbuf())))
    throw Error(file.string() + ": cannot be read; allowed: " + allowed);
  return text.str();
}

}  // namespace

std::string read_set_file(const std::filesystem::path& file) {
  return text_of(file, "a set file (TOML)");
}

Overlay read_overlay(const std::filesystem::path& file) {
  return {file, text_of(file, "a file of settings (TOML)")};
}

Set load_set(const std::filesystem::path& file) {
  return parse_set(read_set_file(file), file);
}

}  // namespace previz::set
