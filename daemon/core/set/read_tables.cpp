#include "daemon/core/set/read_tables.hpp"

#include <algorithm>
#include <cstdint>
#include <sstream>
#include <utility>

#include "drivers/box/reading.hpp"
#include "drivers/keys/toml_value.hpp"

namespace previz::set {
namespace {

class Reader {
 public:
  Reader(std::vector<Section> sections, Homes home_of, Problems& problems)
      : sections_(std::move(sections)), home_of_(std::move(home_of)), problems_(problems) {}

  // `path` is the table's name; "" is the file itself.
  void read(const toml::table& table, const std::string& path) {
    const auto* section = find(path);
    auto opened = section ? section->open() : Section::Opened{nullptr, {}, {}};
    if (opened.given) opened.given->at = position(table.source());

    for (const auto& [name, node] : table) {
      const std::string key(name.str());
      const auto full = path.empty() ? key : path + '.' + key;
      const auto row = std::ranges::find(opened.keys, key, &Key::name);
      if (row != opened.keys.end())
        read_key(*row, *opened.given, position(name.source()), value_of(node));
      else if (opened.others)
        read_other(opened.others, full, position(name.source()), key, value_of(node));
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

  void read_other(const Section::Others& others, const std::string& full, Position at,
                  const std::string& key, const Value& value) {
    try {
      others(at, key, value);
    } catch (const Misread& misread) {
      problems_.add(misread.at, full, misread.what);
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
    const std::string other = repeated ? "" : repeated_like(child.path);
    problems_.add(at, child.path,
                  (repeated ? "is not a list of tables" : "is not a table") +
                      std::string("; allowed: keys under ") + header +
                      (other.empty() ? "" : "; did you mean [[" + other + "]]?"));
  }

  // Returns the name of the tables in double brackets that is nearest to a name.
  std::string repeated_like(const std::string& path) const {
    std::vector<std::string> repeated;
    for (const Section& section : sections_)
      if (section.kind == Section::Kind::repeated) repeated.push_back(section.path);
    return nearest(path, repeated);
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
    } else if (const auto home = home_of_(key); !home.empty()) {
      hint = "does it belong under " + home + "?";
    } else {
      hint = "allowed: ";
      for (const auto& word : near) hint += (&word == near.data() ? "" : ", ") + word;
    }
    problems_.add(at, full, std::string(is_table ? "unknown table; " : "unknown key; ") + hint);
  }

  std::vector<Section> sections_;
  Homes home_of_;
  Problems& problems_;
};

// Returns where a header is first, "[tag]" for example; `otherwise` if it is nowhere.
Position first_header(const std::string& text, const std::string& header, Position otherwise) {
  Position at;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line); ++at.line) {
    const std::size_t begin = line.find_first_not_of(" \t");
    if (begin == std::string::npos || line.compare(begin, header.size(), header) != 0) continue;
    at.column = static_cast<std::uint32_t>(begin + 1);
    return at;
  }
  return otherwise;
}

// The parser takes what comes first for right, and reports the second: [tag] after a [[tag]], or
// the other way round. Adds the problem where the brackets are not those of the section, if that is
// what the parser means.
bool add_other_brackets(const std::string& what, Position at, const std::string& text,
                        const std::vector<Section>& sections, Problems& problems) {
  const std::size_t begin = what.find('\''), end = what.rfind('\'');
  if (what.find("cannot redefine existing") == std::string::npos || begin >= end) return false;
  const std::string path = what.substr(begin + 1, end - begin - 1);
  const auto section = std::ranges::find(sections, path, &Section::path);
  if (section == sections.end() || what.find("' as ") == std::string::npos) return false;
  const std::string one = '[' + path + ']', many = '[' + one + ']';
  if (section->kind != Section::Kind::repeated) {
    problems.add(first_header(text, many, at), path,
                 "is one table; allowed: all its keys under one " + one);
    return true;
  }
  std::vector<std::string> single;
  for (const Section& other : sections)
    if (other.kind != Section::Kind::repeated) single.push_back(other.path);
  const std::string meant = nearest(path, single);
  problems.add(first_header(text, one, at), path,
               "is a list of tables; allowed: " + many +
                   (meant.empty() ? "" : "; did you mean [" + meant + "]?"));
  return true;
}

}  // namespace

std::string home_among(const std::vector<Section>& sections, const std::string& key) {
  for (const auto& section : sections)
    for (const auto& row : section.open().keys)
      if (row.name == key)
        return section.kind == Section::Kind::repeated ? "[[" + section.path + "]]"
                                                       : '[' + section.path + ']';
  return "";
}

toml::table parse_toml(const std::string& text, const std::string& file,
                       const std::vector<Section>& sections, Problems& problems) {
  const box::Reading reading(file);
  try {
    return toml::parse(text, file);
  } catch (const toml::parse_error& error) {
    const std::string what(error.description());
    const auto first = text.find_first_not_of(" \t\r\n");
    if (first != std::string::npos && text[first] == '{')
      problems.add(position(error.source()), "",
                   "is JSON, and a set file is TOML; a list of frames like this is for previz "
                   "import FILE SESSION");
    else if (!add_other_brackets(what, position(error.source()), text, sections, problems))
      problems.add(position(error.source()), "", "not valid TOML: " + what);
    problems.throw_if_any();
    throw;
  }
}

void read_tables(const toml::table& root, const std::vector<Section>& sections,
                 const Homes& home_of, Problems& problems) {
  Reader(sections, home_of, problems).read(root, "");
}

}  // namespace previz::set
