#include "daemon/core/output/asset_store.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <string_view>
#include <system_error>

#include "daemon/core/session/draft.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

namespace fs = std::filesystem;

// A disk is waited for so long when the store ends.
constexpr std::chrono::seconds disk_patience{2};
// The room on the disk is looked at again after so many bytes.
constexpr std::uint64_t bytes_between_looks = 64'000'000;

}  // namespace

std::optional<AssetStore::Delivered> AssetStore::Order::result() const {
  const std::lock_guard lock(mutex_);
  return result_;
}

// Belongs to the store and to its thread, which may outlive the store.
class AssetStore::Worker {
 public:
  Worker(fs::path folder, Assets assets, std::function<void(const std::string&)> note,
         HasRoom has_room)
      : folder_(std::move(folder)),
        assets_(std::move(assets)),
        has_room_(std::move(has_room)),
        note_(std::move(note)),
        hashes_(assets_.size()) {}

  // Runs on the store's thread.
  void run() {
    as_memory_allows([&] { keep_all(); });  // a take that needs what was not kept asks for it again
    while (const std::shared_ptr<Order> order = next_order())
      as_memory_allows([&] { deliver(order); });  // else the take says that it was not copied
    const std::lock_guard lock(mutex_);
    has_ended_ = true;
    changed_.notify_all();
  }

  void add(const std::weak_ptr<Order>& order) {
    const std::lock_guard lock(mutex_);
    orders_.push_back(order);
    changed_.notify_all();
  }

  // Returns whether the thread has ended, or ends at once. It reports nothing from then on.
  bool end() {
    std::unique_lock lock(mutex_);
    is_stopped_ = true;
    changed_.notify_all();
    const bool has_ended = changed_.wait_for(lock, disk_patience, [this] { return has_ended_; });
    if (!has_ended && note_) note_(folder_.string() + ": the disk does not respond; gave up on it");
    note_ = {};
    return has_ended;
  }

  Delivered undelivered(const std::string& why) const {
    Delivered none;
    for (std::size_t i = 0; i < assets_.size(); ++i) none.missing.push_back(missing(i, why));
    return none;
  }

 private:
  static void as_memory_allows(const std::function<void()>& work) {
    try {
      work();
    } catch (const std::bad_alloc&) {
      return;
    }
  }

  void note(const std::string& what) const {
    const std::lock_guard lock(mutex_);
    if (note_) note_(what);
  }

  bool is_stopped() const {
    const std::lock_guard lock(mutex_);
    return is_stopped_;
  }

  std::string hash_of(std::size_t asset) const {
    const std::lock_guard lock(mutex_);
    return hashes_[asset];
  }

  void remember_hash(std::size_t asset, const std::string& hash) {
    const std::lock_guard lock(mutex_);
    hashes_[asset] = hash;
  }

  session::MissingAsset missing(std::size_t i, const std::string& why) const {
    const auto& [as_written, file] = assets_[i];
    return {as_written, file, hash_of(i), why};
  }

  // Returns the oldest order that was not called off; null at the end.
  std::shared_ptr<Order> next_order() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return is_stopped_ || !orders_.empty(); });
      if (is_stopped_) return nullptr;
      std::shared_ptr<Order> order = orders_.front().lock();
      orders_.pop_front();
      if (order) return order;
    }
  }

  void keep_all() {
    const auto is_left = [this] { return is_stopped(); };
    for (std::size_t i = 0; i < assets_.size() && !is_stopped(); ++i) {
      try {
        keep(i, is_left);
      } catch (const std::exception& error) {
        if (!is_stopped())
          note(assets_[i].first + " will be missing from takes: " + reason_of(error));
      }
    }
    try {
      if (!is_stopped() && fs::exists(folder_)) remove_unneeded();
    } catch (const std::exception& error) {
      note(folder_.string() + ": cannot be tidied up: " + reason_of(error));
    }
  }

  // Makes sure that the store has an asset, and returns its file there. The content is that of the
  // first time: a store that was damaged is mended from the file that the set names, if that is
  // still the same.
  fs::path keep(std::size_t asset, const std::function<bool()>& is_left) {
    const fs::path& file = assets_[asset].second;
    const std::string known = hash_of(asset);
    const auto place_of = [&](const std::string& hash) {
      return folder_ / (hash + file.extension().string());
    };
    const std::string hash = known.empty() ? hash_of_file(file, is_left) : known;
    if (known.empty()) remember_hash(asset, hash);
    if (fs::exists(place_of(hash))) return place_of(hash);
    session::make_folders(folder_);
    session::Draft draft(place_of(hash));
    // The name is that of the copy's content, whatever happens to the original meanwhile.
    const std::string copied = copy(file, draft.file(), is_left);
    if (!known.empty() && copied != known)
      throw Error(file.string() + ": was changed since the set was loaded");
    remember_hash(asset, copied);
    draft.put_as_new(place_of(copied));
    return place_of(copied);
  }

  static std::string hash_of_file(const fs::path& file, const std::function<bool()>& is_left) {
    session::Sha256 hash;
    session::read_blocks(file, is_left, [&](std::string_view block) { hash.add(block); });
    return hash.text();
  }

  // Brings a copy to the disk, and returns the hash of its content.
  std::string copy(const fs::path& from, const session::OpenFile& written,
                   const std::function<bool()>& is_left) const {
    struct stat status {};
    if (::stat(from.c_str(), &status) != 0) status = {};
    check_room(static_cast<std::uint64_t>(status.st_size));
    if (status.st_mode != 0) ::fchmod(written.get(), (status.st_mode & 0777) | S_IWUSR);
    session::Sha256 hash;
    std::uint64_t since_look = 0;
    session::read_blocks(from, is_left, [&](std::string_view block) {
      hash.add(block);
      written.append(block);
      since_look += block.size();
      if (since_look < bytes_between_looks) return;
      since_look = 0;
      check_room(0);
    });
    written.sync();
    return hash.text();
  }

  void check_room(std::uint64_t bytes) const {
    if (has_room_ && !has_room_(bytes))
      throw Error(folder_.string() +
                  ": the disk is almost full; takes keep a reserve free "
                  "(recording.reserve_mb)");
  }

  // A file with a second name is in a take.
  void remove_unneeded() const {
    for (const auto& entry : fs::directory_iterator(folder_)) {
      bool is_ours = false;
      for (std::size_t i = 0; i < assets_.size(); ++i)
        is_ours = is_ours || (!hash_of(i).empty() && entry.path().stem() == hash_of(i));
      if (!is_ours && entry.is_regular_file() && entry.hard_link_count() == 1)
        fs::remove(entry.path());
    }
  }

  // An order that only this thread still has was called off.
  void deliver(const std::shared_ptr<Order>& order) {
    const auto is_left = [&] { return is_stopped() || order.use_count() == 1; };
    Delivered delivered;
    for (std::size_t i = 0; i < assets_.size(); ++i) {
      try {
        const fs::path stored = keep(i, is_left);
        put(stored, order->take_ / "assets" / stored.filename(), is_left);
        delivered.assets[assets_[i].first] = "assets/" + stored.filename().string();
      } catch (const std::exception& error) {
        delivered.missing.push_back(missing(i, reason_of(error)));
      }
    }
    if (is_left()) return;
    const std::lock_guard lock(order->mutex_);
    order->result_ = std::move(delivered);
  }

  void put(const fs::path& stored, const fs::path& target,
           const std::function<bool()>& is_left) const {
    session::make_folders(target.parent_path());
    if (fs::exists(target)) return;
    std::error_code cannot_link;
    fs::create_hard_link(stored, target, cannot_link);
    if (!cannot_link) return session::sync_names(target.parent_path());
    session::Draft draft(target);
    copy(stored, draft.file(), is_left);
    draft.put();
  }

  const fs::path folder_;
  const Assets assets_;
  const HasRoom has_room_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::function<void(const std::string&)> note_;  // empty once the store has ended
  std::vector<std::string> hashes_;               // of the assets; empty: not known yet
  std::deque<std::weak_ptr<Order>> orders_;
  bool is_stopped_ = false;
  bool has_ended_ = false;
};

AssetStore::AssetStore(fs::path folder, Assets assets, std::function<void(const std::string&)> note,
                       HasRoom has_room)
    : worker_(std::make_shared<Worker>(std::move(folder), std::move(assets), std::move(note),
                                       std::move(has_room))),
      thread_([worker = worker_] { worker->run(); }) {}

AssetStore::~AssetStore() {
  worker_->end() ? thread_.join() : thread_.detach();
}

std::shared_ptr<AssetStore::Order> AssetStore::deliver(const fs::path& take) {
  auto order = std::make_shared<Order>(take);
  worker_->add(order);
  return order;
}

AssetStore::Delivered AssetStore::undelivered(const std::string& why) const {
  return worker_->undelivered(why);
}

}  // namespace previz::output
