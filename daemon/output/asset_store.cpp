#include "daemon/output/asset_store.hpp"

#include <fcntl.h>

#include <algorithm>
#include <system_error>

#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::output {

AssetStore::AssetStore(std::filesystem::path folder, Assets assets,
                       std::function<void(const std::string&)> note)
    : folder_(std::move(folder)), assets_(std::move(assets)), note_(std::move(note)) {
  thread_ = std::jthread([this](const std::stop_token& stop) { keep_all(stop); });
}

const std::vector<session::StoredFile>& AssetStore::files() {
  is_ready_.wait(false);
  return files_;
}

void AssetStore::keep_all(const std::stop_token& stop) {
  for (const auto& [as_written, file] : assets_) {
    if (stop.stop_requested()) break;
    try {
      files_.push_back({as_written, keep(file)});
    } catch (const std::exception& error) {
      note_(as_written + " will not be in the takes: " + error.what());
    }
  }
  try {
    if (!stop.stop_requested() && std::filesystem::exists(folder_)) remove_unneeded();
  } catch (const std::exception& error) {
    note_(folder_.string() + ": cannot be tidied up: " + error.what());
  }
  is_ready_ = true;
  is_ready_.notify_all();
}

// The name is that of the copy's content, whatever happens to the original meanwhile.
std::filesystem::path AssetStore::keep(const std::filesystem::path& file) const {
  const std::string ending = file.extension().string();
  const std::filesystem::path there = folder_ / (session::sha256_of(file) + ending);
  if (std::filesystem::exists(there)) return there;
  session::make_folders(folder_);
  const std::filesystem::path draft = folder_ / ".part";
  std::filesystem::copy_file(file, draft, std::filesystem::copy_options::overwrite_existing);
  std::filesystem::permissions(draft, std::filesystem::perms::owner_write,
                               std::filesystem::perm_options::add);
  session::OpenFile(draft, O_RDONLY).sync();
  const std::filesystem::path kept = folder_ / (session::sha256_of(draft) + ending);
  std::filesystem::rename(draft, kept);
  session::sync_names(folder_);
  return kept;
}

// A file with a second name is in a take.
void AssetStore::remove_unneeded() const {
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    const bool is_ours = std::ranges::any_of(
        files_, [&](const session::StoredFile& kept) { return kept.file == entry.path(); });
    if (!is_ours && entry.is_regular_file() && entry.hard_link_count() == 1)
      std::filesystem::remove(entry.path());
  }
}

}  // namespace previz::output
