#include "tests/fuzz/mutate_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "tests/fuzz/mutators.hpp"

namespace previz::fuzz {
namespace mutate_tree_cpp {

std::ptrdiff_t signed_of(std::size_t number) {
  return static_cast<std::ptrdiff_t>(number);
}

// Returns "" if chance meets no member of an object.
std::string some_key(Tree& root, std::mt19937& random) {
  for (int tries = 0; tries < 8; ++tries)
    if (std::string key = place_in(root, random).key; !key.empty()) return key;
  return {};
}

// Returns a name that the object does not have yet.
std::string other_name(const Tree& object, Tree& root, const Place& place, std::mt19937& random) {
  std::string name = below(random, 4) == 0 ? std::string{} : some_key(root, random);
  if (name.empty()) name = place.key;
  while (object.contains(name)) name += '2';
  return name;
}

void drop(Tree&, const Place& place, std::mt19937&) {
  place.holder->erase(std::next(place.holder->begin(), signed_of(place.at)));
}

void repeat(Tree& root, const Place& place, std::mt19937& random) {
  const Tree copy = place.value();
  if (place.holder->is_object()) {
    const std::string name = other_name(*place.holder, root, place, random);
    (*place.holder)[name] = copy;
    return;
  }
  const std::size_t times = below(random, 8) == 0 ? 40 : 1 + below(random, 3);
  place.holder->insert(std::next(place.holder->begin(), signed_of(place.at)), times, copy);
}

// Returns whether one of the places is in the other, or is the other.
bool one_holds_other(const Place& a, const Place& b) {
  const std::size_t common = std::min(a.path.size(), b.path.size());
  return std::equal(a.path.begin(), a.path.begin() + signed_of(common), b.path.begin());
}

// A value that holds the other one becomes the other one.
void swap_values(Tree& root, const Place& place, std::mt19937& random) {
  Place other = place_in(root, random);
  for (int tries = 0; tries < 4 && other.path == place.path; ++tries)
    other = place_in(root, random);
  if (!one_holds_other(place, other)) {
    place.value().swap(other.value());
    return;
  }
  const bool is_outer = place.path.size() < other.path.size();
  Tree inner = (is_outer ? other : place).value();
  (is_outer ? place : other).value() = std::move(inner);
}

void copy_value(Tree& root, const Place& place, std::mt19937& random) {
  Tree copy = place_in(root, random).value();
  place.value() = std::move(copy);
}

// Where the object has the name already, the two members exchange their names.
void rename(Tree& root, const Place& place, std::mt19937& random) {
  if (!place.holder->is_object()) return swap_values(root, place, random);
  const std::string old_name = std::next(place.holder->begin(), signed_of(place.at)).key();
  std::string name = some_key(root, random);
  if (name == old_name) name += '2';
  Tree moved = std::move(place.value());
  if (place.holder->contains(name))
    (*place.holder)[old_name] = std::move((*place.holder)[name]);
  else
    place.holder->erase(old_name);
  (*place.holder)[name] = std::move(moved);
}

void nest(Tree& root, const Place& place, std::mt19937& random) {
  Tree inner = std::move(place.value());
  Tree outer = Tree::array();
  if (below(random, 3) == 0)
    outer = Tree{{place.key, std::move(inner)}};
  else
    outer.push_back(std::move(inner));
  place.value() = std::move(outer);
  static_cast<void>(root);
}

const std::vector<Tree>& extreme_values() {
  using Limits = std::numeric_limits<double>;
  static const std::vector<Tree> values = {
      0,
      1,
      -1,
      0.5,
      -0.0,
      Limits::quiet_NaN(),
      Limits::infinity(),
      -Limits::infinity(),
      1e308,
      -1e308,
      1e-300,
      -1e-320,
      std::int64_t{1} << 31,
      std::int64_t{1} << 32,
      (std::int64_t{1} << 53) + 1,
      std::numeric_limits<std::int64_t>::max(),
      std::numeric_limits<std::int64_t>::min(),
      9223372036854775808.0,
      "",
      std::string(300, 'a'),
      std::string(5000, 'b'),
      std::string("a\0b", 3),
      "../../../../etc/hostname",
      "/dev/null",
      ".",
      "\xf0\x9f\x8e\xac\n",
      nullptr,
      true,
      false,
      Tree::array(),
      Tree::object(),
      Tree::array({0, 0, 0}),
      Tree::array({Tree::array()}),
  };
  return values;
}

void make_extreme(Tree&, const Place& place, std::mt19937& random) {
  const std::vector<Tree>& values = extreme_values();
  place.value() = values[below(random, values.size())];
}

Tree near_number(const Tree& number, std::mt19937& random) {
  if (number.is_number_integer() && below(random, 4) != 0) {
    const auto bits = number.get<std::uint64_t>();  // wraps where the integer is the last
    return static_cast<std::int64_t>(below(random, 2) == 0 ? bits + 1 : bits - 1);
  }
  const double value = number.get<double>();
  const std::array<double, 7> near = {-value,       2 * value,    value / 2,        value + 1,
                                      1e-3 * value, 1e12 * value, std::floor(value)};
  return near[below(random, near.size())];
}

Tree near_text(std::string text, std::mt19937& random) {
  switch (below(random, 3)) {
    case 0:
      return text + text;
    case 1:
      return text + ' ';
    default:
      std::ranges::transform(text, text.begin(), [](char c) {
        return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
      });
      return text;
  }
}

// A list becomes empty, short, or its own reverse.
void change_list(Tree& list, std::mt19937& random) {
  switch (below(random, 3)) {
    case 0:
      list.clear();
      break;
    case 1:
      if (list.empty()) break;
      list.erase(std::next(list.begin(), signed_of(below(random, list.size()))), list.end());
      break;
    default:
      std::reverse(list.begin(), list.end());
  }
}

void make_near(Tree& root, const Place& place, std::mt19937& random) {
  Tree& value = place.value();
  if (value.is_number())
    value = near_number(value, random);
  else if (value.is_string())
    value = near_text(value.get<std::string>(), random);
  else if (value.is_boolean())
    value = !value.get<bool>();
  else if (value.is_array())
    change_list(value, random);
  else
    copy_value(root, place, random);
}

// Bytes of text that are not UTF-8 cannot be there: no parser lets them in.
void change_type(Tree& root, const Place& place, std::mt19937& random) {
  Tree& value = place.value();
  if (value.is_number() || value.is_boolean())
    value = value.dump();
  else if (value.is_string())
    value = value.get_ref<const std::string&>().size();
  else if (value.is_object())
    value = Tree(value.size(), value.empty() ? Tree() : value.front());
  else
    make_extreme(root, place, random);
}

using Change = void (*)(Tree& root, const Place& place, std::mt19937& random);

constexpr std::array<Change, 12> changes = {
    drop,   repeat, swap_values,  copy_value,   rename,    nest,
    repeat, drop,   make_extreme, make_extreme, make_near, change_type,
};

}  // namespace mutate_tree_cpp

Place place_in(Tree& root, std::mt19937& random) {
  Place place{&root, 0, {}, {}};
  while (true) {
    place.at = below(random, place.holder->size());
    place.path.push_back(place.at);
    const auto child = std::next(place.holder->begin(), mutate_tree_cpp::signed_of(place.at));
    if (place.holder->is_object()) place.key = child.key();
    // One in four stops early, so that whole tables and lists are changed too.
    if (!child->is_structured() || child->empty() || below(random, 4) == 0) return place;
    place.holder = &*child;
  }
}

void change_tree(Tree& root, std::mt19937& random, std::span<const Tree> words) {
  using namespace mutate_tree_cpp;
  if (root.empty()) return;
  const Place place = place_in(root, random);
  if (!words.empty() && below(random, 8) == 0)
    place.value() = words[below(random, words.size())];
  else
    changes[below(random, changes.size())](root, place, random);
}

}  // namespace previz::fuzz
