// Changes of a tree of objects, lists and values, as TOML and JSON are.
#pragma once

#include <cstddef>
#include <iterator>
#include <nlohmann/json.hpp>
#include <random>
#include <span>
#include <string>
#include <vector>

namespace previz::fuzz {

using Tree = nlohmann::json;

// A place below the root of a tree.
struct Place {
  Tree* holder = nullptr;  // the object or list that has it; not null
  std::size_t at = 0;      // its position there, from 0
  std::string key;         // of the innermost member that it is or is in; "" if there is none
  std::vector<std::size_t> path;  // the positions from the root on, `at` last

  Tree& value() const { return *std::next(holder->begin(), static_cast<std::ptrdiff_t>(at)); }
};

// Returns a random place. The root must be an object or a list that is not empty.
Place place_in(Tree& root, std::mt19937& random);

// Makes one change below the root, whose type stays: something is dropped, repeated, swapped,
// renamed, copied, nested, emptied, or becomes a value of another type, a number that is extreme or
// near, or one of `words`, which may be empty. Numbers may become infinite or NaN, and values null.
// The root must be an object or a list; an empty one is left as it is. Now and then nothing
// changes.
void change_tree(Tree& root, std::mt19937& random, std::span<const Tree> words);

// Makes one to three changes by `change`, and a few more while nothing has changed.
template <typename Change>
void change_some(Tree& root, std::mt19937& random, const Change& change) {
  const Tree before = root;
  for (std::size_t times = 1 + random() % 3; times > 0; --times) change(root, random);
  for (int tries = 0; tries < 4 && root == before; ++tries) change(root, random);
}

}  // namespace previz::fuzz
