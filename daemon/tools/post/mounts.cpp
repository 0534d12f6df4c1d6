#include "daemon/tools/post/mounts.hpp"

#include <mntent.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <string_view>

namespace previz::post {
namespace {

struct LocalLocks {
  std::string_view type;  // how the file system's type begins
  std::string_view option, value;
};
// The options are those of nfs(5), mount.lustre(8) and mount.cifs(8); sshfs has no locks of its
// own.
constexpr std::array<LocalLocks, 6> with_local_locks{{{"nfs", "local_lock", "all"},
                                                      {"nfs", "local_lock", "posix"},
                                                      {"lustre", "localflock", ""},
                                                      {"cifs", "nobrl", ""},
                                                      {"smb3", "nobrl", ""},
                                                      {"fuse.sshfs", "", ""}}};

bool has_option(const mntent& mount, const LocalLocks& kind) {
  if (kind.option.empty()) return true;
  const char* const found = ::hasmntopt(&mount, std::string(kind.option).c_str());
  if (!found || kind.value.empty()) return found != nullptr;
  std::string_view value(found);
  value = value.substr(0, value.find(','));
  return value.substr(std::min(value.size(), kind.option.size() + 1)) == kind.value;
}

bool is_below(const std::filesystem::path& path, const std::filesystem::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

std::string local_locks_of(const mntent& mount) {
  for (const LocalLocks& kind : with_local_locks) {
    if (!std::string_view(mount.mnt_type).starts_with(kind.type) || !has_option(mount, kind))
      continue;
    std::string words = mount.mnt_type;
    if (!kind.option.empty()) words += " with " + std::string(kind.option);
    if (!kind.value.empty()) words += "=" + std::string(kind.value);
    return words;
  }
  return "";
}

}  // namespace

std::string local_locks_of(const std::filesystem::path& folder, const char* table) {
  std::error_code unknown;
  const std::filesystem::path path = std::filesystem::canonical(folder, unknown);
  const std::unique_ptr<FILE, int (*)(FILE*)> mounts(::setmntent(table, "re"), ::endmntent);
  if (unknown || !mounts) return "";
  std::string words;
  std::size_t longest = 0;
  std::array<char, 16384> text{};
  mntent mount{};
  // The later of two at one place lies above.
  while (::getmntent_r(mounts.get(), &mount, text.data(), static_cast<int>(text.size()))) {
    const std::string_view place = mount.mnt_dir;
    if (place.size() < longest || !is_below(path, place)) continue;
    longest = place.size();
    words = local_locks_of(mount);
  }
  return words;
}

}  // namespace previz::post
