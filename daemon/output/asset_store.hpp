// Keeps the files that the takes of a set need beside the takes, each once, under the hash of its
// content. They are copied when a set is loaded, in a thread of their own; a take then gets them by
// hard links, which takes no time whatever they weigh, and as they were when the set was loaded.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "drivers/session/session.hpp"

namespace previz::output {

class AssetStore {
 public:
  using Assets = std::vector<std::pair<std::string, std::filesystem::path>>;  // as written: file

  // Begins to copy into `folder`, which is made if there is anything to keep. Files there that no
  // take and none of these assets needs are removed. `note` is called from the store's thread for
  // each asset that cannot be kept.
  AssetStore(std::filesystem::path folder, Assets assets,
             std::function<void(const std::string&)> note);

  bool is_ready() const { return is_ready_; }
  // Waits until it is ready, and returns what could be kept.
  const std::vector<session::StoredFile>& files();

 private:
  void keep_all(const std::stop_token& stop);
  std::filesystem::path keep(const std::filesystem::path& file) const;
  void remove_unneeded() const;

  const std::filesystem::path folder_;
  const Assets assets_;
  const std::function<void(const std::string&)> note_;
  std::vector<session::StoredFile> files_;  // written by the thread until it is ready
  std::atomic<bool> is_ready_ = false;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace previz::output
