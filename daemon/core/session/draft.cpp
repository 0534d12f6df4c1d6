#include "daemon/core/session/draft.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <random>
#include <set>
#include <shared_mutex>
#include <utility>

#include "drivers/error.hpp"

namespace previz::session {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t chance_digits = 16, longest_name = 255;
constexpr std::string_view ending = ".part";

[[noreturn]] void fail_draft(const fs::path& file, const char* what) {
  throw Error(file.string() + ": " + what + ": " + std::strerror(errno));
}

// ".NAME.0123456789abcdef.part"; a long NAME is cut.
fs::path name_of_chance(const fs::path& target) {
  std::random_device random;
  const std::uint64_t chance = std::uint64_t{random()} << 32 | random();
  std::array<char, chance_digits + 1> digits{};
  std::snprintf(digits.data(), digits.size(), "%016llx", static_cast<unsigned long long>(chance));
  std::string name = target.filename().string();
  name.resize(std::min(name.size(), longest_name - chance_digits - ending.size() - 2));
  return target.parent_path() / ("." + name + "." + digits.data() + std::string(ending));
}

bool is_draft_name(const std::string& name) {
  if (name.size() < 1 + 1 + chance_digits + ending.size() || name.front() != '.' ||
      !name.ends_with(ending))
    return false;
  const std::string digits =
      name.substr(name.size() - ending.size() - chance_digits, chance_digits);
  return digits.find_first_not_of("0123456789abcdef") == std::string::npos;
}

// The drafts of this process that are not in their place. Never destroyed: threads may outlive the
// end of main().
struct OwnDrafts {
  std::shared_timed_mutex placing;  // held, together, by those that put one in place
  std::mutex mutex;                 // of `paths`; no disk is waited for under it
  std::set<fs::path> paths;

  void add(const fs::path& draft) {
    const std::lock_guard lock(mutex);
    paths.insert(draft);
  }
  void forget(const fs::path& draft) {
    const std::lock_guard lock(mutex);
    paths.erase(draft);
  }
};
OwnDrafts& own_drafts() {
  static auto* const all = new OwnDrafts;
  return *all;
}

// Returns false where another process found the draft before it was locked, and removes it, or
// where the disk has failed; what is left of the draft is then removed.
bool lock(const OwnedDescriptor& draft, const fs::path& path) {
  struct stat status {};
  if (draft && (::flock(draft.get(), LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) &&
      ::fstat(draft.get(), &status) == 0 && status.st_nlink > 0)
    return true;
  std::error_code gone;
  fs::remove(path, gone);
  return false;
}

// Renames a draft, whose path is empty afterwards.
void put_in_place(fs::path& draft, const fs::path& target, const char* failure) {
  const std::shared_lock placing(own_drafts().placing);
  if (std::rename(draft.c_str(), target.c_str()) != 0) fail_draft(target, failure);
  own_drafts().forget(std::exchange(draft, {}));
}

void sync_folder_of(const fs::path& file) {
  sync_names(file.parent_path());
}

}  // namespace

Draft::Made Draft::make(const fs::path& target) {
  for (;;) {
    fs::path path = name_of_chance(target);
    OwnedDescriptor made(
        ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
    if (!made && errno == EEXIST) continue;
    if (!made) fail_draft(target, "cannot be created");
    if (!lock(made, path)) continue;
    own_drafts().add(path);
    return {std::move(path), std::move(made)};
  }
}

Draft::Draft(const fs::path& target) : Draft(target, make(target)) {}

Draft::Draft(fs::path target, Made made)
    : target_(std::move(target)),
      path_(std::move(made.path)),
      file_(std::move(made.descriptor), target_) {}

Draft::Draft(Draft&& other) noexcept
    : target_(std::move(other.target_)),
      path_(std::exchange(other.path_, {})),
      file_(std::move(other.file_)) {}

Draft::~Draft() {
  if (path_.empty()) return;
  std::error_code ignored;
  fs::remove(path_, ignored);
  own_drafts().forget(path_);
}

void Draft::keep_owner() const {
  struct stat known {};
  if (::lstat(target_.c_str(), &known) != 0 || !S_ISREG(known.st_mode)) return;
  // Only root may give a file away, so that a refusal is no error.
  [[maybe_unused]] const int refused = ::fchown(file_.get(), known.st_uid, known.st_gid);
  if (::fchmod(file_.get(), known.st_mode & 07777) != 0)
    fail_draft(target_, "cannot be given its mode");
}

void Draft::put(Sync sync) {
  if (sync == Sync::yes) file_.sync();
  put_in_place(path_, target_, "cannot be renamed into place");
  if (sync == Sync::yes) sync_folder_of(target_);
}

bool Draft::put_as_new(const fs::path& target) {
  file_.sync();
  std::shared_lock placing(own_drafts().placing);
  const bool is_linked = ::link(path_.c_str(), target.c_str()) == 0;
  const bool has_no_links = errno == EPERM || errno == EOPNOTSUPP || errno == ENOSYS;
  if (is_linked) {
    std::error_code stays;  // a second name; it counts as left by a dead process
    fs::remove(path_, stays);
  } else if (errno == EEXIST) {
    return false;
  } else if (!has_no_links || ::renameat2(AT_FDCWD, path_.c_str(), AT_FDCWD, target.c_str(),
                                          RENAME_NOREPLACE) != 0) {
    if (errno == EEXIST) return false;
    fail_draft(target, "cannot be renamed into place");
  }
  own_drafts().forget(std::exchange(path_, {}));
  placing.unlock();
  sync_folder_of(target);
  return true;
}

DraftFolder::DraftFolder(const fs::path& target) : target_(fs::absolute(target)) {
  if (!target_.has_filename()) target_ = target_.parent_path();
  for (;;) {
    path_ = name_of_chance(target_);
    const bool made = ::mkdir(path_.c_str(), 0777) == 0;
    if (!made && errno == EEXIST) continue;
    if (!made) fail_draft(target_.parent_path(), "a folder cannot be created in it");
    lock_ = OwnedDescriptor(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!lock_ && errno != ENOENT) {
      const int error = errno;
      std::error_code stays;
      fs::remove(path_, stays);
      errno = error;
      fail_draft(path_, "cannot be opened");
    }
    if (!lock(lock_, path_)) continue;
    own_drafts().add(path_);
    return;
  }
}

DraftFolder::~DraftFolder() {
  if (path_.empty()) return;
  std::error_code ignored;
  fs::remove_all(path_, ignored);
  own_drafts().forget(path_);
}

void DraftFolder::put() {
  put_in_place(path_, target_, "cannot be created");
  sync_folder_of(target_);
}

void abandon_drafts() {
  constexpr std::chrono::milliseconds patience(200);  // a disk may hang
  OwnDrafts& own = own_drafts();
  if (!own.placing.try_lock_for(patience)) return;  // never unlocked
  const std::lock_guard lock(own.mutex);
  for (const fs::path& draft : own.paths) {
    // Other threads may still write into a folder, but not by its name once it has another.
    std::string name = draft.string();
    char& digit = name.at(name.rfind('.') - 1);
    digit = digit == '0' ? '1' : '0';
    std::error_code failure;
    fs::rename(draft, name, failure);
    if (failure) name = draft.string();
    for (int tries = 0; tries < 10; ++tries) {
      fs::remove_all(name, failure);
      if (!failure) break;
    }
  }
}

void replace_file(const std::filesystem::path& file, const std::string& content) {
  Draft draft(file);
  draft.keep_owner();
  draft.file().append(content);
  draft.put();
}

std::vector<std::string> remove_dead_drafts(const fs::path& folder) {
  std::vector<std::string> removed;
  std::error_code unreadable;
  for (fs::directory_iterator entry(folder, unreadable), end; !unreadable && entry != end;
       entry.increment(unreadable)) {
    const std::string name = entry->path().filename().string();
    if (!is_draft_name(name)) continue;
    const int kind =
        entry->is_directory() && !entry->is_symlink() ? O_RDONLY | O_DIRECTORY : O_RDWR;
    const OwnedDescriptor draft(
        ::open(entry->path().c_str(), kind | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    if (!draft || ::flock(draft.get(), LOCK_EX | LOCK_NB) != 0) continue;
    std::error_code stays;
    if (fs::remove_all(entry->path(), stays) > 0 && !stays) removed.push_back(name);
  }
  return removed;
}

}  // namespace previz::session
