// Makes files and folders that are whole or not there, after a crash and a power cut as well: each
// is written under a name of chance beside its place, which no link can lie in wait under, and gets
// its own name when it is complete. A draft is locked (flock(2)) as long as its process works on
// it, so that what a dead one left is known by that.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/session/files.hpp"
#include "drivers/descriptor.hpp"

namespace previz::session {

// Whether a file must be there after a power cut. One that another replaces a second later need
// not, and the disk that takes are written to is not made to wait for it.
enum class Sync { yes, no };

class Draft {
 public:
  // Makes an empty draft in the folder of `target`. Throws previz::Error naming the target.
  explicit Draft(const std::filesystem::path& target);
  ~Draft();  // removes it unless it was put in place
  Draft(Draft&& other) noexcept;
  Draft& operator=(Draft&&) = delete;

  // The draft, open for reading and writing; its errors name the target.
  const OpenFile& file() const { return file_; }
  // For libraries that open a file by its name.
  const std::filesystem::path& path() const { return path_; }
  const std::filesystem::path& target() const { return target_; }

  // Gives the draft the owner, as far as the system lets it, and the mode of the file it replaces.
  void keep_owner() const;
  // Puts the draft in the place of the target, whatever is there. Throws previz::Error.
  void put(Sync sync = Sync::yes);
  // Puts the draft under another name in the same folder; returns false if that is taken.
  bool put_as_new(const std::filesystem::path& target);

 private:
  struct Made {
    std::filesystem::path path;
    OwnedDescriptor descriptor;
  };
  static Made make(const std::filesystem::path& target);
  Draft(std::filesystem::path target, Made made);

  std::filesystem::path target_, path_;  // path_: empty once it is in place
  OpenFile file_;
};

class DraftFolder {
 public:
  // Makes an empty folder beside `target`. Throws previz::Error.
  explicit DraftFolder(const std::filesystem::path& target);
  ~DraftFolder();  // removes it, with all that is in it, unless it was put in place
  DraftFolder(const DraftFolder&) = delete;
  DraftFolder& operator=(const DraftFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // Gives the folder its name, where nothing or an empty folder may be. Throws previz::Error.
  void put();

 private:
  std::filesystem::path target_, path_;
  OwnedDescriptor lock_;
};

// Replaces the file's content at once: a crash or a power cut leaves the old or the new, never a
// part, and after the return the new. The mode stays, and the owner where the system lets it.
// Throws previz::Error; the old content then stays.
void replace_file(const std::filesystem::path& file, const std::string& content);

// Removes all drafts of this process, none of which can be put in place any more: its threads wait
// for ever where they try to. They stay where a disk holds up one that is just being put in place.
// For a process that ends in the middle of its work.
void abandon_drafts();

// Removes the drafts, files and folders, that dead processes left in a folder, and returns their
// names. Those that cannot be locked or removed stay: their process lives, or the file system knows
// no locks.
std::vector<std::string> remove_dead_drafts(const std::filesystem::path& folder);

}  // namespace previz::session
