// The folders of takes: the preferred one, and perhaps a second on another disk, where a recording
// goes on when the first is full or fails. A folder also remembers, over a crash, a power cut, a
// restart and an upgrade, that somebody wishes to record.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace previz::output {

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

  // Makes the first folder that has room and is not given up, and returns it. Throws previz::Error
  // that says of each folder why it cannot be used.
  std::filesystem::path choose();
  bool has_room(const std::filesystem::path& folder) const;
  // Gives a folder up, because its disk failed, until forgive_all(). Returns whether another is
  // left.
  bool give_up(const std::filesystem::path& folder);
  void forgive_all() { given_up_.clear(); }

  // Returns how much takes may still use of all disks, without the reserves; nothing if no disk can
  // say.
  std::optional<std::uint64_t> free_bytes() const;

  // Measures how many bytes a second the disk of the folder that choose() would return takes, by a
  // file of up to 64 MB that is removed again; at most about a second. Nothing if there is no room
  // for it. Throws previz::Error.
  std::optional<double> measure_speed();

  // Writes into the take's folder that it is being recorded. Throws previz::Error.
  static void keep_wish(const std::filesystem::path& take);
  // Removes what the folders remember: the recording was ended, or it cannot go on. Throws
  // previz::Error if one of them cannot.
  void drop_wish() const;
  // Returns the name of the take that was being recorded when the last process ended, if one was:
  // the newest that a folder remembers.
  std::optional<std::string> kept_wish() const;

 private:
  std::uint64_t free_on_disk_of(const std::filesystem::path& folder) const;
  std::string why_full(const std::filesystem::path& folder) const;  // empty: it has room

  const std::vector<std::filesystem::path> folders_;
  const std::uint64_t reserve_bytes_;
  const FreeBytes free_bytes_;
  std::set<std::filesystem::path> given_up_;
};

}  // namespace previz::output
