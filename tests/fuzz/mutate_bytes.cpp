#include <algorithm>
#include <array>
#include <cstring>

#include "tests/fuzz/mutators.hpp"

namespace previz::fuzz {

std::string mutate_bytes(std::string bytes, std::mt19937& random) {
  static constexpr std::array<std::uint32_t, 6> words = {0,          1,          0x7fffffff,
                                                         0x80000000, 0xffffffff, 0x7fc00000};
  for (std::size_t times = 1 + below(random, 3); times > 0 && !bytes.empty(); --times) {
    const std::size_t at = below(random, bytes.size());
    switch (below(random, 5)) {
      case 0:
        bytes[at] = static_cast<char>(random());
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ 1 << below(random, 8));
        break;
      case 2:
        std::memcpy(&bytes[at], &words[below(random, words.size())],
                    std::min<std::size_t>(4, bytes.size() - at));
        break;
      case 3:
        bytes.erase(at, 1 + below(random, 8));
        break;
      default:
        bytes.insert(at, bytes, below(random, bytes.size()), 1 + below(random, 8));
    }
  }
  return bytes;
}

}  // namespace previz::fuzz
