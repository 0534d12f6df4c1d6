#include "daemon/core/output/folder_watch.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <ctime>
#include <list>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "daemon/core/output/memory.hpp"
#include "daemon/core/output/salvage.hpp"
#include "daemon/core/output/take_writer.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

namespace fs = std::filesystem;
using WatchClock = std::chrono::steady_clock;

// A disk is waited for so long when the watch ends.
constexpr std::chrono::seconds end_patience{2};
constexpr const char* owner_name = ".recorder";

// Returns why files cannot be made in a folder, or where it is to be made; empty if they can.
std::string why_not_writable(const fs::path& folder) {
  const fs::path there = existing_part(folder);
  std::error_code unknown;
  if (!fs::is_directory(there, unknown)) return "it is not a folder";
  return ::access(there.c_str(), W_OK) == 0 ? "" : std::strerror(errno);
}

std::string owner_words() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  std::string since(32, '\0');
  since.resize(std::strftime(since.data(), since.size(), "%Y-%m-%d %H:%M:%S", &local));
  return "process " + std::to_string(::getpid()) + ", since " + since;
}

// A file that a process holds locked. File systems without locks let everybody have it.
class Ownership {
 public:
  // Returns why it cannot be had; empty if it is held.
  std::string take(const fs::path& folder) {
    if (held_) return "";
    const fs::path file = folder / owner_name;
    OwnedDescriptor open(
        ::open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0644));
    if (!open) return file.string() + " cannot be opened: " + std::strerror(errno);
    if (::flock(open.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
      return "another previzd records there (" + first_line(file) + ")";
    static_cast<void>(!::ftruncate(open.get(), 0));
    const std::string words = owner_words() + "\n";
    static_cast<void>(!::write(open.get(), words.data(), words.size()));  // for people
    held_ = std::move(open);
    return "";
  }
  void leave() { held_ = {}; }

 private:
  static std::string first_line(const fs::path& file) {
    try {
      session::PlainLines lines(file);
      std::string line;
      lines.next(line);
      return line.substr(0, 200);
    } catch (const Error& error) {
      return reason_of(error);
    }
  }
  OwnedDescriptor held_;
};

struct Followed {
  fs::path take;
  dev_t disk = 0;
  ino_t file = 0;
};

}  // namespace

class FolderWatch::Worker {
 public:
  explicit Worker(FolderWatchOptions options)
      : options_(std::move(options)),
        salvage_({options_.folder}, [this](const std::string& what) { note(what); }) {
    seen_.folder = options_.folder;
  }

  void run() {
    std::unique_lock lock(mutex_);
    for (WatchClock::time_point due{}; !(is_ended_ && tasks_.empty());) {
      changed_.wait_until(lock, due, [this] { return is_ended_ || !tasks_.empty(); });
      std::list<Task> task;  // at most one
      if (!tasks_.empty()) task.splice(task.begin(), tasks_, tasks_.begin());
      busy_since_ = WatchClock::now();
      in_hand_ = task.size();
      lock.unlock();
      bool is_done = true;
      try {
        if (!task.empty()) {
          carry_out(task.front());
        } else if (WatchClock::now() >= due) {
          due = WatchClock::now() + interval;
          look();
        }
      } catch (const std::bad_alloc&) {  // it is done once there is memory again
        is_done = false;
        std::this_thread::sleep_for(memory_interval);
      }
      lock.lock();
      busy_since_.reset();
      in_hand_ = 0;
      if (!is_done && !task.empty()) tasks_.splice(tasks_.begin(), task);
    }
    has_ended_ = true;
    changed_.notify_all();
  }

  // Returns whether the thread has ended, or ends at once.
  bool end() {
    std::unique_lock lock(mutex_);
    is_ended_ = true;
    changed_.notify_all();
    const bool has_ended = changed_.wait_for(lock, end_patience, [this] { return has_ended_; });
    lock.unlock();
    if (!has_ended) note(options_.folder.string() + ": the disk does not respond; gave up on it");
    is_left_ = true;
    {
      const std::lock_guard calls(calls_);
      options_.note = {};
      options_.on_news = {};
    }
    const std::unique_lock owner(owner_mutex_, std::try_to_lock);
    if (owner) owner_.leave();
    return has_ended;
  }

  FolderSeen seen() const {
    const std::lock_guard lock(mutex_);
    FolderSeen seen = seen_;
    seen.tasks = tasks_.size() + in_hand_;
    if (busy_since_)
      seen.silent_s = std::chrono::duration<double>(WatchClock::now() - *busy_since_).count();
    return seen;
  }

  std::string hold() {
    const std::lock_guard lock(owner_mutex_);
    std::string why_not = owner_.take(options_.folder);
    if (is_left_) owner_.leave();
    return why_not;
  }

  void follow(const fs::path& take) {
    struct stat status {};
    const bool is_there = ::stat(take.c_str(), &status) == 0;
    const std::lock_guard lock(mutex_);
    seen_.take_gone.clear();
    followed_.reset();
    if (is_there) followed_ = {take, status.st_dev, status.st_ino};
  }

  void add(std::function<void()> action, std::string otherwise) {
    const std::lock_guard lock(mutex_);
    tasks_.push_back({std::move(action), std::move(otherwise)});
    changed_.notify_all();
  }

  const fs::path& folder() const { return options_.folder; }
  const std::string& slate() const { return options_.slate; }

 private:
  struct Task {
    std::function<void()> action;
    std::string otherwise;  // what follows if it fails, in words
  };

  void note(const std::string& what) {
    const std::lock_guard lock(calls_);
    if (options_.note) options_.note(what);
  }

  void carry_out(const Task& task) {
    try {
      task.action();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      note(task.otherwise + ": " + reason_of(error));
    }
  }

  void look() {
    FolderSeen now = seen();
    now.is_looked_at = true;
    std::error_code unknown;
    now.is_there = fs::exists(options_.folder, unknown);
    now.why_not = why_not_writable(options_.folder);
    now.disk = disk_of(options_.folder);
    now.free_bytes.reset();
    try {
      now.free_bytes = free_on_disk_of(options_.folder, options_.free_bytes);
    } catch (const std::exception&) {
      // This disk cannot say.
    }
    if (now.is_there && now.why_not.empty()) now.why_not = hold();
    now.is_own = now.is_there && now.why_not.empty();
    if (now.is_own)
      bring_into_order(now);
    else if (now.is_there && !std::exchange(has_said_why_not_, true))
      note("earlier takes cannot be checked: " + options_.folder.string() + ": " + now.why_not);
    publish(std::move(now));
    const std::lock_guard lock(calls_);
    if (options_.on_news) options_.on_news();
  }

  // Salvages the takes that the process before left, and reads what it was recording; once.
  void bring_into_order(FolderSeen& now) {
    if (is_in_order_) return;
    const TakeFolders alone({options_.folder}, 0, {});
    now.highest_number =
        next_take_number({options_.folder}, options_.slate, now.highest_number) - 1;
    const auto say = [this](const std::string& what) { note(what); };
    now.kept_number = alone.kept_number(options_.slate, say);
    salvage_.look(now.salvaged);
    now.wish = alone.kept_wish(say);
    is_in_order_ = true;
  }

  void publish(FolderSeen now) {
    std::optional<Followed> followed;
    {
      const std::lock_guard lock(mutex_);
      followed = followed_;
    }
    struct stat status {};
    const bool is_gone =
        followed && (::stat(followed->take.c_str(), &status) != 0 ||
                     status.st_dev != followed->disk || status.st_ino != followed->file);
    const std::lock_guard lock(mutex_);
    const bool is_same = followed && followed_ && followed->take == followed_->take;
    now.take_gone = is_gone && is_same ? followed->take.string() +
                                             " is gone; its disk was unmounted, or it "
                                             "was moved"
                                       : "";
    seen_ = std::move(now);
  }

  FolderWatchOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  FolderSeen seen_;
  std::list<Task> tasks_;
  std::optional<Followed> followed_;
  std::optional<WatchClock::time_point> busy_since_;
  std::size_t in_hand_ = 0;  // tasks that are being done: one or none
  bool is_ended_ = false, has_ended_ = false;
  std::mutex calls_;  // held while the options' functions are called
  std::mutex owner_mutex_;
  Ownership owner_;
  std::atomic<bool> is_left_ = false;
  // Only the watch's thread uses these.
  Salvage salvage_;
  bool is_in_order_ = false, has_said_why_not_ = false;
};

FolderWatch::FolderWatch(FolderWatchOptions options)
    : worker_(std::make_shared<Worker>(std::move(options))),
      thread_([worker = worker_] { worker->run(); }) {}

FolderWatch::~FolderWatch() {
  worker_->end() ? thread_.join() : thread_.detach();
}

FolderSeen FolderWatch::seen() const {
  return worker_->seen();
}

std::string FolderWatch::hold() {
  return worker_->hold();
}

void FolderWatch::follow(const fs::path& take) {
  worker_->follow(take);
}

void FolderWatch::keep_wish(const fs::path& take) {
  worker_->add([take] { TakeFolders::keep_wish(take); },
               "recording would not resume after a restart");
}

void FolderWatch::keep_number(int number) {
  worker_->add(
      [folder = worker_->folder(), slate = worker_->slate(), number] {
        TakeFolders::keep_number(folder, slate, number);
      },
      "if the other disk is missing at the next start, a take may get the name of one on it");
}

void FolderWatch::drop_wish() {
  worker_->add([folder = worker_->folder()] { TakeFolders({folder}, 0, {}).drop_wish(); },
               "after a restart it would begin by itself");
}

}  // namespace previz::output
