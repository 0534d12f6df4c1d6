#include "daemon/core/live/snapshots.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <optional>
#include <system_error>

#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::live {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view snapshot_prefix = "snapshot_";
// An EXR has 20 floats a pixel that was rendered, a PNG three samples of 16 bits a pixel that was
// shown; either may grow by compression that finds nothing to compress.
constexpr std::uint64_t most_exr_bytes = 20 * sizeof(float) + 1;
constexpr std::uint64_t most_png_bytes = 3 * sizeof(std::uint16_t) + 1;

fs::path snapshot_file(fs::path stem, const char* extension) {
  return stem += extension;
}

// Returns N of "snapshot_N" with anything after it; 0 of any other name.
int number_of(const std::string& name) {
  int number = 0;
  if (!name.starts_with(snapshot_prefix)) return 0;
  std::from_chars(name.data() + snapshot_prefix.size(), name.data() + name.size(), number);
  return std::clamp(number, 0, 999'999'999);
}

// Returns the device of the file system on which a folder is, or would be made.
std::optional<dev_t> disk_of(fs::path folder) {
  struct stat known {};
  folder = fs::absolute(folder);
  while (::stat(folder.c_str(), &known) != 0) {
    if (!folder.has_relative_path()) return std::nullopt;
    folder = folder.parent_path();
  }
  return known.st_dev;
}

}  // namespace

fs::path put_snapshot(session::Draft& exr) {
  const fs::path folder = exr.target().parent_path();
  int last = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    last = std::max(last, number_of(entry.path().filename().string()));
  for (int number = last + 1;; ++number) {
    std::array<char, 32> name{};
    std::snprintf(name.data(), name.size(), "%s%04d", snapshot_prefix.data(), number);
    fs::path stem = folder / name.data();
    if (exr.put_as_new(snapshot_file(stem, ".exr"))) return stem;
  }
}

void check_space(const fs::path& folder, std::uint64_t bytes, const fs::path& takes,
                 std::uint64_t reserve_bytes) {
  std::error_code unknown;
  const fs::space_info space = fs::space(folder, unknown);
  if (unknown) return;  // whether there is room is then seen by writing
  const bool same_disk = disk_of(folder) == disk_of(takes);
  const std::uint64_t wanted = bytes + (same_disk ? reserve_bytes : 0);
  if (space.available < wanted)
    throw Error(folder.string() + ": no snapshot is written, because " +
                std::to_string(space.available / 1'000'000) + " MB are free and " +
                std::to_string(wanted / 1'000'000) + " are needed" +
                (same_disk ? ", with recording.reserve_mb" : ""));
}

fs::path write_snapshot(const pipeline::Shot& shot, const set::Set& set) {
  const fs::path& folder = set.output.directory;
  session::make_folders(folder);
  const std::uint64_t bytes =
      shot.layers->mask.size() * most_exr_bytes + shot.picture->samples.size() / 3 * most_png_bytes;
  check_space(folder, bytes, set.recording.directory,
              static_cast<std::uint64_t>(set.recording.reserve_mb * 1e6));
  output::ExrMetadata metadata = output::exr_metadata(*shot.layers, *shot.frame, shot.track, set);
  if (shot.shown_pose) {
    metadata.pose = "held";
    metadata.world_from_camera = shot.shown_pose->world_from_camera;
  }
  session::Draft exr = output::exr_draft(folder / "snapshot.exr", *shot.layers, metadata);
  fs::path stem = put_snapshot(exr);
  output::write_png(snapshot_file(stem, ".png"), *shot.picture);
  return stem;
}

}  // namespace previz::live
