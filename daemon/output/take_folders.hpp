// The folders of takes: the preferred one, and perhaps a second on another disk, where a recording
// goes on when the first is full or fails. A folder also remembers, over a crash, a power cut, a
// restart and an upgrade, that somebody wishes to record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace previz::output {

// Returns whether both folders are, or will be made, on one disk.
bool are_on_one_disk(const std::filesystem::path& a, const std::filesystem::path& b);

// Used by one thread, since every call may wait for a disk.
class TakeFolders {
 public:
  // Bytes that are free on a folder's disk; throws std::filesystem::filesystem_error.
  using FreeBytes = std::function<std::uint64_t(const std::filesystem::path& folder)>;

  // `folders` in the order of preference, at least one; none of them need exist. A folder with less
  // than `reserve_bytes` is full. `free_bytes` may be empty: the file system is asked.
  TakeFolders(std::vector<std::filesystem::path> folders, std::uint64_t reserve_bytes,
              FreeBytes free_bytes);

  const std::vector<std::filesystem::path>& all() const { return folders_; }

  // Makes the first folder that has room and is not given up, and returns its index. Throws
  // previz::Error that says of each folder why it cannot be used.
  std::size_t choose();
  // Returns why a folder is full; empty: it has room.
  std::string why_full(std::size_t folder) const;
  // Gives a folder up until forgive_all(), because its disk failed or is full. Returns whether
  // another is left.
  bool give_up(std::size_t folder, const std::string& why);
  void forgive_all();
  // Returns a function that says whether so many bytes more leave a folder what is kept free; it
  // may be called by any thread, and after the end of this.
  std::function<bool(std::uint64_t bytes)> room_of(std::size_t folder) const;

  // Returns how much takes may still use of all disks, without the reserves, those that were given
  // up, and those that cannot be written; nothing if no disk can say.
  std::optional<std::uint64_t> free_bytes() const;

  // Measures how many bytes a second the disk of the folder that choose() would return takes, by a
  // file of up to 64 MB that is removed again; at most about a second. Nothing if there is no room
  // for it. Throws previz::Error.
  std::optional<double> measure_speed();

  // Writes into the take's folder that it is being recorded. Throws previz::Error.
  static void keep_wish(const std::filesystem::path& take);
  // Removes what the folders remember: the recording was ended, or it cannot go on. Throws
  // previz::Error that names those that cannot; the others have forgotten it then.
  void drop_wish() const;
  // Returns the name of the take that was being recorded when the last process ended, if one was:
  // the newest that a folder remembers. A folder that cannot be read remembers nothing.
  std::optional<std::string> kept_wish() const;

 private:
  const std::vector<std::filesystem::path> folders_;
  const std::uint64_t reserve_bytes_;
  const FreeBytes free_bytes_;
  std::vector<std::string> given_up_;  // why, for each folder; empty: it is not
};

}  // namespace previz::output
