#include "daemon/core/lighting/expansion.hpp"

#include <array>
#include <cstddef>

namespace previz::lighting {
namespace {

constexpr int reach = 2;
constexpr std::array binomial{1.0f / 16, 4.0f / 16, 6.0f / 16, 4.0f / 16, 1.0f / 16};

// Returns the share of over-exposed pixels around a pixel; beyond the picture's edge there are
// none.
float share_clipped(const HdrPicture& picture, int x, int y) {
  float share = 0;
  for (int dy = -reach; dy <= reach; ++dy) {
    if (y + dy < 0 || y + dy >= picture.height) continue;
    for (int dx = -reach; dx <= reach; ++dx) {
      if (x + dx < 0 || x + dx >= picture.width) continue;
      const auto p = static_cast<std::size_t>((y + dy) * picture.width + x + dx);
      if (picture.flags[p] & overexposed)
        share += binomial[static_cast<std::size_t>(dx + reach)] *
                 binomial[static_cast<std::size_t>(dy + reach)];
    }
  }
  return share;
}

}  // namespace

void expand_clipped(HdrPicture& picture, double gain) {
  if (gain == 1) return;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const auto p = static_cast<std::size_t>(y * picture.width + x);
      if (picture.flags[p] & overexposed)
        picture.radiance[p] *= 1 + static_cast<float>(gain - 1) * share_clipped(picture, x, y);
    }
  }
}

}  // namespace previz::lighting
