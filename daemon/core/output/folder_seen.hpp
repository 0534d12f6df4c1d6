// What was seen of a folder of takes.
#pragma once

#include <sys/types.h>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace previz::output {

// The take that was being recorded, by its name, and when that was written down.
struct KeptWish {
  std::string take;
  std::filesystem::file_time_type time;
};

struct FolderSeen {
  std::filesystem::path folder;
  bool is_looked_at = false;  // at least once; the rest is empty before
  bool is_there = false;
  bool is_own = false;  // no other process records into it, and it was brought into order
  // Why no take can be made there, or is to be made: it cannot be written, or another process
  // records there. Empty: they can.
  std::string why_not;
  std::optional<std::uint64_t> free_bytes;  // of its disk; nothing: the disk cannot say
  std::optional<dev_t> disk;
  int highest_number = 0;  // of the slate's takes, as the folder was found
  int kept_number = 0;     // TakeFolders::kept_number(), as it was found
  // Takes that the process before left cut off and that are in order again, in words, and the take
  // that it was recording.
  std::vector<std::string> salvaged;
  std::optional<KeptWish> wish;
  // Why the followed take is no longer there: its disk was unmounted, or it was moved. Empty: it
  // is.
  std::string take_gone;
  // For how long the disk has not answered what it is being asked, and how much it was asked to do
  // that is not done.
  double silent_s = 0;
  std::size_t tasks = 0;
};

}  // namespace previz::output
