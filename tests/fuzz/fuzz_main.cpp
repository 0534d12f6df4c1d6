// libFuzzer's entry into the target that PREVIZ_FUZZ_TARGET names. tests/fuzz/run.sh starts it.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/targets.hpp"

namespace {

const previz::fuzz::Target* chosen = nullptr;

// Where a program changes inputs itself, libFuzzer lets them be of any length from the beginning.
// Bytes without a structure are to grow slowly nevertheless: 100 is what libFuzzer takes elsewhere.
// What the command line says comes after this, and goes before it.
void control_length(int& count, char**& arguments) {
  static std::string option = "-len_control=100";
  static std::vector<char*> all;
  all.assign(arguments, arguments + count);
  all.insert(all.begin() + 1, option.data());
  count = static_cast<int>(all.size());
  all.push_back(nullptr);
  arguments = all.data();
}

}  // namespace

// libFuzzer's own change of bytes, which lie in room for `room` bytes. Returns their new number.
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t room);

extern "C" int LLVMFuzzerInitialize(int* count, char*** arguments) {
  const char* name = std::getenv("PREVIZ_FUZZ_TARGET");
  chosen = name ? previz::fuzz::find_target(name) : nullptr;
  if (chosen) {
    if (!chosen->mutate) control_length(*count, *arguments);
    return 0;
  }
  std::fputs("PREVIZ_FUZZ_TARGET must be one of these:\n", stderr);
  for (const previz::fuzz::Target& target : previz::fuzz::targets())
    std::printf("%-14s %s\n", target.name, target.reads);
  std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  previz::fuzz::accepts(*chosen, {data, size});
  return 0;
}

// Changes the structure in three of four cases, where the target has one and the bytes have it, and
// else bytes.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t room, unsigned int seed) {
  std::mt19937 random(seed);
  if (chosen->mutate && random() % 4 != 0) {
    const std::optional<std::string> changed = chosen->mutate({data, size}, random);
    if (changed && changed->size() <= room) {
      std::ranges::copy(*changed, data);
      return changed->size();
    }
  }
  return LLVMFuzzerMutate(data, size, room);
}
