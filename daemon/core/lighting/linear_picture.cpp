#include "daemon/core/lighting/linear_picture.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "drivers/error.hpp"

namespace previz::lighting {

void check_size(const std::filesystem::path& path, std::int64_t width, std::int64_t height) {
  if (width < 1 || height < 1 || width > most_pixels / height ||
      std::max(width, height) > most_side)
    throw Error(fmt::format("{}: has {}x{} pixels; allowed: at most {}, and {} per side",
                            path.string(), width, height, most_pixels, most_side));
}

void reserve_pixels(LinearPicture& picture, std::uintmax_t bytes) {
  constexpr std::uintmax_t pixels_a_byte = 8;  // of clear skies, well compressed
  const auto pixels =
      static_cast<std::uintmax_t>(picture.width) * static_cast<std::uintmax_t>(picture.height);
  picture.radiance.reserve(std::min(pixels, pixels_a_byte * bytes));
}

}  // namespace previz::lighting
