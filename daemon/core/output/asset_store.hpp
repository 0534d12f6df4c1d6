// Keeps the files that the takes of a set need in a folder of takes, each once, under the hash of
// its content. They are copied when a set is loaded, and put into each take by hard links where the
// file system can, else by copies; all of it in a thread of the store's own. So no take waits for a
// file or ends because of one, and takes have the files as they were when the set was loaded.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/core/session/session.hpp"

namespace previz::output {

class AssetStore {
 public:
  using Assets = std::vector<std::pair<std::string, std::filesystem::path>>;  // as written: file
  // Returns whether so many bytes more may be written to the folder's disk. The store's thread
  // calls it, and where the disk hangs perhaps after the store's end.
  using HasRoom = std::function<bool(std::uint64_t bytes)>;

  // What of the assets is in a take.
  struct Delivered {
    std::map<std::string, std::string> assets;  // as written: path below the take's folder
    std::vector<session::MissingAsset> missing;
  };
  // A take's order. Its end calls the order off.
  class Order {
   public:
    explicit Order(std::filesystem::path take) : take_(std::move(take)) {}
    // Returns what was delivered; nothing while the store is at it.
    std::optional<Delivered> result() const;

   private:
    friend class AssetStore;
    const std::filesystem::path take_;
    mutable std::mutex mutex_;
    std::optional<Delivered> result_;
  };

  // Begins to copy into `folder`, which is made if there is anything to keep. Files there that no
  // take and none of these assets needs are removed. `note` is called from the store's thread for
  // each asset that cannot be kept. `has_room` may be empty: there is room.
  AssetStore(std::filesystem::path folder, Assets assets,
             std::function<void(const std::string&)> note, HasRoom has_room = {});
  // Ends what the store is at. Where a disk does not answer, its thread is left alone after two
  // seconds.
  ~AssetStore();
  AssetStore(const AssetStore&) = delete;
  AssetStore& operator=(const AssetStore&) = delete;

  // Begins to put the assets into the folder "assets" of a take, once they are kept.
  std::shared_ptr<Order> deliver(const std::filesystem::path& take);
  // Returns what a take has that was not waited for: nothing, because of `why`.
  Delivered undelivered(const std::string& why) const;

 private:
  class Worker;
  std::shared_ptr<Worker> worker_;
  std::thread thread_;
};

}  // namespace previz::output
