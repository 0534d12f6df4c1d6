// Changes of structure for the fuzzer: the bytes are read as their format, something that they
// consist of is changed, and they are written again, so that nearly all that comes out is well
// formed and reaches what lies behind a parser. What the changes are is decided by the random
// numbers alone, in the same way on every machine.
#pragma once

#include <cstddef>
#include <optional>
#include <random>
#include <string>

#include "tests/fuzz/targets.hpp"

namespace previz::fuzz {

// Each makes one to three changes, and returns null where the bytes are not of its format or hold
// nothing that could be changed. None throws but for a lack of memory. The result may be several
// times as long as the bytes, and is now and then equal to them.

// A TOML document. Comments, the order of keys and the notation of numbers are lost; dates become
// text.
std::optional<std::string> mutate_toml(Bytes bytes, std::mt19937& random);
// A JSON document that is an object or an array, nested at most 64 deep.
std::optional<std::string> mutate_json(Bytes bytes, std::mt19937& random);
// A JSON document in each line: lines are changed as mutate_json does, swapped, repeated, dropped.
// Lines that are no JSON stay as they are, but at least one must be.
std::optional<std::string> mutate_json_lines(Bytes bytes, std::mt19937& random);
// A glTF file, JSON or binary. The lengths of a binary file and of its chunks are right.
std::optional<std::string> mutate_gltf(Bytes bytes, std::mt19937& random);
// A Matroska or WebM file. The sizes of elements are right, but for those that are changed to be
// wrong, those that already were, and, once in 32 changes, all that hold what is changed.
std::optional<std::string> mutate_matroska(Bytes bytes, std::mt19937& random);
// The bytes of the target import_video: JSON, or Matroska behind its two bytes.
std::optional<std::string> mutate_import_video(Bytes bytes, std::mt19937& random);

// Changes one to three places of any bytes: one of them, the four from there on to a number that is
// extreme, or some are dropped or repeated.
std::string mutate_bytes(std::string bytes, std::mt19937& random);

// Returns a number from 0 to count - 1. The count must be 1 at least.
inline std::size_t below(std::mt19937& random, std::size_t count) {
  return static_cast<std::size_t>(random()) % count;
}

}  // namespace previz::fuzz
