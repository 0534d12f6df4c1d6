#include "daemon/rig/loaded_set.hpp"

#include <algorithm>
#include <vector>

#include "drivers/session/files.hpp"

namespace previz::rig {

LoadedSet load_whole_set(const std::filesystem::path& file) {
  LoadedSet loaded;
  std::error_code missing;  // which reading it tells in better words
  loaded.changed = std::filesystem::last_write_time(file, missing);
  loaded.text = session::read_file(file);
  loaded.set = set::parse_set(loaded.text, file);
  loaded.scene = scene::load_scene(loaded.set);
  return loaded;
}

std::filesystem::path neighbour(const std::filesystem::path& file, int next) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".toml" && entry.is_regular_file())
      files.push_back(entry.path().filename());
  std::ranges::sort(files);
  const auto at = std::ranges::lower_bound(files, file.filename()) - files.begin();
  const auto count = static_cast<std::ptrdiff_t>(files.size());
  return count == 0
             ? file
             : file.parent_path() / files[static_cast<std::size_t>((at + next + count) % count)];
}

}  // namespace previz::rig
