// libFuzzer's entry into the target that PREVIZ_FUZZ_TARGET names. tests/fuzz/run.sh starts it.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <random>
#include <string>

#include "tests/fuzz/targets.hpp"

namespace {

const previz::fuzz::Target* chosen = nullptr;

}  // namespace

// libFuzzer's own change of bytes, which lie in room for `room` bytes. Returns their new number.
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t room);

extern "C" int LLVMFuzzerInitialize(int* /*count*/, char*** /*arguments*/) {
  const char* name = std::getenv("PREVIZ_FUZZ_TARGET");
  chosen = name ? previz::fuzz::find_target(name) : nullptr;
  if (chosen) return 0;
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
      std::memcpy(data, changed->data(), changed->size());
      return changed->size();
    }
  }
  return LLVMFuzzerMutate(data, size, room);
}
