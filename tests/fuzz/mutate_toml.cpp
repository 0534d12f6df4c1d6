#include <toml++/toml.h>

#include <cstdint>
#include <limits>
#include <sstream>
#include <string_view>
#include <utility>

#include "tests/fuzz/mutate_tree.hpp"
#include "tests/fuzz/mutators.hpp"

namespace previz::fuzz {
namespace mutate_toml_cpp {

Tree tree_of(const toml::node& node) {
  return node.visit([](const auto& value) -> Tree {
    if constexpr (toml::is_table<decltype(value)>) {
      Tree object = Tree::object();
      for (const auto& [key, child] : value) object[std::string(key.str())] = tree_of(child);
      return object;
    } else if constexpr (toml::is_array<decltype(value)>) {
      Tree list = Tree::array();
      for (const toml::node& child : value) list.push_back(tree_of(child));
      return list;
    } else if constexpr (toml::is_chronological<decltype(value)>) {
      std::ostringstream text;
      text << value.get();
      return text.str();
    } else {
      return value.get();
    }
  });
}

toml::table table_of(const Tree& object);
toml::array array_of(const Tree& list);

// Calls `add` with what the tree is in TOML, but for null, which TOML does not have.
template <typename Add>
void add_node(const Tree& tree, const Add& add) {
  if (tree.is_object())
    add(table_of(tree));
  else if (tree.is_array())
    add(array_of(tree));
  else if (tree.is_string())
    add(tree.get<std::string>());
  else if (tree.is_boolean())
    add(tree.get<bool>());
  else if (tree.is_number_float())
    add(tree.get<double>());
  else if (tree.is_number_unsigned() &&
           tree.get<std::uint64_t>() > std::numeric_limits<std::int64_t>::max())
    add(std::numeric_limits<std::int64_t>::max());
  else if (tree.is_number())
    add(tree.get<std::int64_t>());
}

toml::table table_of(const Tree& object) {
  toml::table table;
  for (auto member = object.begin(); member != object.end(); ++member)
    add_node(*member, [&](auto&& node) {
      table.insert_or_assign(member.key(), std::forward<decltype(node)>(node));
    });
  return table;
}

toml::array array_of(const Tree& list) {
  toml::array array;
  for (const Tree& child : list)
    add_node(child, [&](auto&& node) { array.push_back(std::forward<decltype(node)>(node)); });
  return array;
}

}  // namespace mutate_toml_cpp

std::optional<std::string> mutate_toml(Bytes bytes, std::mt19937& random) {
  using namespace mutate_toml_cpp;
  Tree tree;
  try {
    tree = tree_of(toml::parse(std::string_view(text_of(bytes))));
  } catch (const toml::parse_error&) {
    return std::nullopt;
  }
  if (tree.empty()) return std::nullopt;
  change_some(tree, random, [](Tree& root, std::mt19937& r) { change_tree(root, r, {}); });
  std::ostringstream text;
  text << table_of(tree) << '\n';
  return text.str();
}

}  // namespace previz::fuzz
