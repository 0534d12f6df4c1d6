// libFuzzer's entry into the target that PREVIZ_FUZZ_TARGET names. tests/fuzz/run.sh starts it.
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/targets.hpp"

namespace {

const previz::fuzz::Target* chosen = nullptr;

}  // namespace

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
