// The folders of takes: the preferred one, and perhaps a second on another disk, where a recording
// goes on when the first is full or fails. A folder also remembers, over a crash, a power cut, a
// restart and an upgrade, that somebody wishes to record, and which takes are in the other.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/output/folder_seen.hpp"
#include "daemon/core/session/video_codec.hpp"
#include "drivers/frame.hpp"

namespace previz::output {

// Returns whether both folders are, or will be made, on one disk.
bool are_on_one_disk(const std::filesystem::path& a, const std::filesystem::path& b);

// Return the part of a path that is there, and the device and free bytes of its disk. All may wait
// for it. The free bytes are those of `free_bytes`, if that is not empty; throws
// std::filesystem::filesystem_error.
std::filesystem::path existing_part(const std::filesystem::path& folder);
std::optional<dev_t> disk_of(const std::filesystem::path& folder);
std::uint64_t free_on_disk_of(
    const std::filesystem::path& folder,
    const std::function<std::uint64_t(const std::filesystem::path& folder)>& free_bytes);

// Used by one thread, since every call may wait for a disk.
class TakeFolders {
 public:
  using Note = std::function<void(const std::string&)>;
  // Bytes that are free on a folder's disk; throws std::filesystem::filesystem_error.
  using FreeBytes = std::function<std::uint64_t(const std::filesystem::path& folder)>;

  // `folders` in the order of preference, at least one; none of them need exist. A folder with less
  // than `reserve_bytes` is full. `free_bytes` may be empty: the file system is asked.
  TakeFolders(std::vector<std::filesystem::path> folders, std::uint64_t reserve_bytes,
              FreeBytes free_bytes);

  const std::vector<std::filesystem::path>& all() const { return folders_; }

  // Makes the first folder that has room and is not given up, and returns its index. Throws
  // previz::Error that says of each folder why it cannot be used.
  // A folder for which `why_not` returns anything is not made, and said with that.
  std::size_t choose(const std::function<std::string(std::size_t)>& why_not = {});
  // Returns why a folder is full; empty: it has room.
  std::string why_full(std::size_t folder) const;
  // Gives a folder up until forgive_all(), because its disk failed or is full. Returns whether
  // another is left.
  bool give_up(std::size_t folder, const std::string& why);
  void forgive_all();
  // Returns a function that says whether so many bytes more leave a folder what is kept free; it
  // may be called by any thread, and after the end of this.
  std::function<bool(std::uint64_t bytes)> room_of(std::size_t folder) const;

  // Returns how much takes may still use of all disks, as the folders were last seen: without the
  // reserves, those that were given up, and those that cannot be written; nothing if no disk can
  // say. Waits for no disk.
  std::optional<std::uint64_t> free_bytes(const std::vector<FolderSeen>& seen) const;

  // Measures how many bytes a second the disk of the folder that choose() would return takes, by a
  // file of up to 64 MB that is removed again; at most about a second. Nothing if there is no room
  // for it. Throws previz::Error.
  std::optional<double> measure_speed();
  // Records frames, as takes are, into a folder that is removed again, until all of them are on the
  // medium or a second is over. Returns how many were written a second; nothing if there is no
  // room. Throws previz::Error.
  std::optional<double> measure_frame_rate(const std::vector<FramePtr>& frames,
                                           session::VideoCodec codec);

  // Writes into the take's folder that it is being recorded. Throws previz::Error.
  static void keep_wish(const std::filesystem::path& take);
  // Removes what the folders remember: the recording was ended, or it cannot go on. Throws
  // previz::Error that names those that cannot; the others have forgotten it then.
  void drop_wish() const;
  // Returns the take that was being recorded when the last process ended, if one was: the newest
  // that a folder remembers. A folder that cannot be read remembers nothing; `note` is told why.
  std::optional<KeptWish> kept_wish(const Note& note = {}) const;

  // Writes into a folder that the slate has a take of this number, there or elsewhere, so that no
  // other gets its name while the disk of that one is not there. Throws previz::Error.
  static void keep_number(const std::filesystem::path& folder, const std::string& slate,
                          int number);
  // Returns the highest of those numbers that the folders can say; 0 if there is none. `note` is
  // told of those that cannot.
  int kept_number(const std::string& slate, const Note& note = {}) const;

 private:
  const std::vector<std::filesystem::path> folders_;
  const std::uint64_t reserve_bytes_;
  const FreeBytes free_bytes_;
  std::vector<std::string> given_up_;  // why, for each folder; empty: it is not
};

}  // namespace previz::output
