#include "daemon/rig/snapshots.hpp"

#include <array>
#include <cstdio>

#include "daemon/output/exr.hpp"
#include "daemon/output/png.hpp"
#include "drivers/error.hpp"

namespace previz::rig {

std::filesystem::path write_snapshot(const pipeline::Shot& shot, const set::Set& set) {
  const auto with = [](std::filesystem::path stem, const char* extension) {
    return stem += extension;
  };
  std::filesystem::path stem;
  for (int number = 1;; ++number) {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "snapshot_%04d", number);
    stem = set.output.directory / name.data();
    if (!std::filesystem::exists(with(stem, ".exr")) &&
        !std::filesystem::exists(with(stem, ".png")))
      break;
  }
  output::write_exr(with(stem, ".exr"), *shot.layers,
                    output::exr_metadata(*shot.layers, *shot.frame, shot.track, set));
  output::write_png(with(stem, ".png"), *shot.picture);
  return stem;
}

}  // namespace previz::rig
