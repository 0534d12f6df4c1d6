// Looks at one folder of takes from a thread of its own, and does there what may wait: a disk that
// stands still keeps this thread, and neither the recording on another disk nor the rig's main
// loop. What was seen has an age.
//
// The watch also holds the folder for its process (flock(2) of ".recorder" in it), so that two
// daemons do not record into one folder.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "daemon/core/output/folder_seen.hpp"
#include "daemon/core/output/take_folders.hpp"

namespace previz::output {

struct FolderWatchOptions {
  std::filesystem::path folder;
  std::string slate;                             // of the takes that are counted
  TakeFolders::FreeBytes free_bytes;             // empty: the file system is asked
  std::function<void(const std::string&)> note;  // what could not be read or done; of any thread
  std::function<void()> on_news;                 // called after each look, on the watch's thread
};

class FolderWatch {
 public:
  static constexpr std::chrono::seconds interval{1};  // between two looks

  explicit FolderWatch(FolderWatchOptions options);
  // Waits for what was asked to be done, at most two seconds. Nothing is called from then on, and
  // the folder is another process's to take.
  ~FolderWatch();
  FolderWatch(const FolderWatch&) = delete;
  FolderWatch& operator=(const FolderWatch&) = delete;

  FolderSeen seen() const;  // waits for nothing

  // Take the folder for this process now; return why it cannot be had, empty if it is. The folder
  // must exist, and the call may wait for its disk.
  std::string hold();
  // From now on looks say whether this take, which is there, is still there. May wait for the disk.
  void follow(const std::filesystem::path& take);

  // They are done on the watch's thread, in the order of the calls; what fails is noted.
  void keep_wish(const std::filesystem::path& take);  // TakeFolders::keep_wish()
  void keep_number(int number);                       // TakeFolders::keep_number()
  void drop_wish();                                   // TakeFolders::drop_wish(), of this folder

 private:
  class Worker;
  const std::shared_ptr<Worker> worker_;  // its thread may outlive the watch
  std::thread thread_;
};

}  // namespace previz::output
