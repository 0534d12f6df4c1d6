#include "daemon/core/output/salvage.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <system_error>

#include "daemon/core/output/take_list.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/check.hpp"

namespace previz::output {

bool Salvage::look(std::vector<std::string>& salvaged) {
  bool is_first = false;
  std::vector<std::filesystem::path> takes;
  std::vector<bool> is_looked_at = is_looked_at_;  // once all is done: memory may run out before
  for (std::size_t i = 0; i < folders_.size(); ++i) {
    if (is_looked_at_[i]) continue;
    try {
      if (!std::filesystem::exists(folders_[i])) continue;
      is_first = true;
      is_looked_at[i] = true;
      for (const auto& entry : std::filesystem::directory_iterator(folders_[i]))
        if (may_be_take(entry.path()) && entry.is_directory() && !entry.is_symlink())
          takes.push_back(entry.path());
      session::remove_dead_drafts(folders_[i]);
    } catch (const std::filesystem::filesystem_error& error) {
      is_looked_at[i] = true;  // once, and not each second
      note_("earlier takes cannot be checked: " + std::string(error.what()));
    }
  }
  std::ranges::sort(takes, {}, [](const auto& take) { return take.filename(); });
  for (const std::filesystem::path& take : takes) salvage(take, salvaged);
  is_looked_at_ = std::move(is_looked_at);
  return is_first;
}

void Salvage::salvage(const std::filesystem::path& take, std::vector<std::string>& salvaged) const {
  try {
    const std::optional<std::uint64_t> frames = session::salvage(take);
    if (frames) session::remove_dead_drafts(take);
    if (frames)
      salvaged.push_back(take.filename().string() + " was cut off; it has " +
                         set::plural(*frames, "frame"));
  } catch (const std::exception& error) {
    note_("an earlier take cannot be read: " + std::string(error.what()));
  }
}

}  // namespace previz::output
