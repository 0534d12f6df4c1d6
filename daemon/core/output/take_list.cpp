#include "daemon/core/output/take_list.hpp"

#include <string.h>

#include <algorithm>

#include "daemon/core/output/take_folders.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

// A folder that nobody may look into counts as one, and so does a session.toml that is no file:
// that a take is there and cannot be read must be seen.
bool is_take(const std::filesystem::path& directory) {
  std::error_code unknown;
  const auto kind = std::filesystem::symlink_status(directory / "session.toml", unknown).type();
  return kind != std::filesystem::file_type::not_found;
}

// Returns whether the folder of the take remembers that the take is being recorded.
bool is_remembered(const std::filesystem::path& take) {
  const std::filesystem::path parent = std::filesystem::absolute(take).parent_path();
  const std::optional<KeptWish> wish = TakeFolders({parent}, 0, {}).kept_wish();
  return wish && wish->take == take.filename();
}

ListedTake look_at(const std::filesystem::path& directory) {
  ListedTake take;
  take.directory = directory;
  try {
    take.summary = session::summary_of(directory);
    const bool is_over = take.summary.closed || !take.summary.fault.empty();
    take.may_be_in_recording =
        !is_over && (is_remembered(directory) || session::is_being_written(directory));
  } catch (const std::exception& error) {  // of std::filesystem as well
    take.fault = reason_of(error);
  }
  try {
    take.strangers = session::strangers_in(directory);
    for (const std::filesystem::path& file : session::own_files(directory)) {
      std::error_code failure;
      const std::uintmax_t size = std::filesystem::file_size(directory / file, failure);
      if (!failure)
        take.bytes += size;
      else if (failure != std::errc::no_such_file_or_directory)  // it was removed just now
        throw Error((directory / file).string() + ": cannot be looked at: " + failure.message());
    }
  } catch (const std::exception& error) {
    if (take.fault.empty()) take.fault = reason_of(error);
  }
  return take;
}

}  // namespace

std::filesystem::path named(const std::filesystem::path& directory) {
  const std::filesystem::path normal = directory.lexically_normal();
  return normal.has_filename() || !normal.has_parent_path() ? normal : normal.parent_path();
}

bool may_be_take(const std::filesystem::path& directory) {
  const std::string name = directory.filename().string();
  return name != "lost+found" && !name.starts_with('.');
}

ListedTake listed_take(const std::filesystem::path& directory) {
  const std::filesystem::path take = named(directory);
  if (is_take(take)) return look_at(take);
  if (!std::filesystem::exists(take))
    throw Error(take.string() + ": not found; `previz takes list` shows the existing takes");
  const bool holds_takes = std::filesystem::is_directory(take) && !list_takes({take}).empty();
  throw Error(take.string() + (holds_takes ? ": is a folder of takes; give the takes in it"
                                           : ": is not a take; it holds no session.toml"));
}

std::vector<ListedTake> list_takes(const std::vector<std::filesystem::path>& folders) {
  std::vector<ListedTake> takes;
  for (const std::filesystem::path& folder : folders) {
    std::vector<std::filesystem::path> names;
    std::error_code failure;
    for (const auto& entry : std::filesystem::directory_iterator(folder, failure))
      if (may_be_take(entry.path()) && is_take(entry.path()))
        names.push_back(entry.path().filename());
    if (failure && failure != std::errc::no_such_file_or_directory)
      throw Error(folder.string() + ": cannot be listed: " + failure.message());
    std::ranges::sort(
        names, [](const auto& a, const auto& b) { return ::strverscmp(a.c_str(), b.c_str()) < 0; });
    for (const std::filesystem::path& name : names) takes.push_back(look_at(folder / name));
  }
  return takes;
}

}  // namespace previz::output
