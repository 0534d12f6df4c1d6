// Shares a folder of rendered pictures between processes, on one machine or on several over NFS:
// says which frame is at whose, and lets one at a time change what is common. The locks are those
// of fcntl(2), F_OFD_SETLK, on bytes of DIR/render.lock; they go with the death of their process.
// The text in that file is for people and for messages; what holds is the locks. Where these do not
// reach other machines, what holds is the text: a process has the frames of its line as long as it
// renews its lease of that line, DIR/render.leases/N (Leases), and a lease stands for the lock of a
// transaction. Everybody who finds render.leases takes part in it from his next transaction on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/tools/post/leases.hpp"
#include "drivers/descriptor.hpp"

struct flock;

namespace previz::post {

// A process that is at work in the folder.
struct FolderUser {
  std::string host;  // empty: its line in render.lock is not whole
  std::int64_t pid = 0;
  std::string since;               // "2026-11-25 14:03 UTC"
  std::set<std::uint64_t> frames;  // that it is rendering
};

// Returns "previz 4711 on host a, since 2026-11-25 14:03 UTC".
std::string words_of(const FolderUser& user);

// Returns the name of this machine, by which a cluster knows it (SLURMD_NODENAME) where it is
// one's.
std::string host_name();

// fcntl(2); a test puts that of a file system without locks in its place.
using LockCall = int (*)(int descriptor, int command, struct flock* range);
int call_fcntl(int descriptor, int command, struct flock* range);

// Returns the processes that are at work in the folder. Waits for none, and makes no file. Throws
// previz::Error where that cannot be known.
std::vector<FolderUser> users_of(const std::filesystem::path& folder, LockCall call = call_fcntl);

// Not for several threads at once; two objects exclude each other even in one process.
class FolderLocks {
 public:
  static constexpr const char* file_name = "render.lock";

  // Opens or makes render.lock. Throws previz::Error, also where that is a link.
  explicit FolderLocks(const std::filesystem::path& folder, LockCall call = call_fcntl);
  ~FolderLocks();  // lets everything go, and takes the process's line out of the text
  FolderLocks(const FolderLocks&) = delete;
  FolderLocks& operator=(const FolderLocks&) = delete;

  // Why other machines are seen by leases only, in words: the file system has no locks, or they
  // hold on this machine. Empty: they are seen.
  const std::string& missing() const { return missing_; }

  // As long as it lives, no other process is in one.
  class Transaction {
   public:
    // Waits for it; throws previz::Error on a stop, or after five minutes, naming who else is
    // there: a transaction takes less than a second.
    explicit Transaction(FolderLocks& locks, const std::stop_token& stop = {});
    ~Transaction();
    Transaction(const Transaction&) = delete;
    Transaction& operator=(const Transaction&) = delete;

   private:
    FolderLocks& locks_;
  };

  // All that follow are called within a transaction. They throw previz::Error where render.lock
  // cannot be written or read.

  // Adds this process to those that are at work here.
  void join();
  // Returns the other processes that are at work here.
  std::vector<FolderUser> others() const;
  // Takes the first of the frames that no other process has, at most `most`, and returns them. Who
  // claims has joined.
  std::set<std::uint64_t> claim(const std::set<std::uint64_t>& frames, std::uint64_t most);
  void release(std::uint64_t frame);
  bool is_at_another(std::uint64_t frame) const;
  // Takes the review video, until this object ends; returns false if another process has it.
  bool claim_video();

 private:
  friend std::vector<FolderUser> users_of(const std::filesystem::path& folder, LockCall call);
  FolderLocks(const std::filesystem::path& file, OwnedDescriptor open, LockCall call);
  void look_for_leases();
  void see_others();
  bool lock(std::uint64_t byte);
  bool lock_in_file(std::uint64_t byte);
  void unlock(std::uint64_t byte);
  bool is_locked_by_another(std::uint64_t byte) const;
  // Fills in a lock that is in the way of this one, or that there is none.
  void look_at(struct flock& range) const;
  // Adds the lines among these bytes that other processes hold.
  void add_locked(std::uint64_t begin, std::uint64_t end, std::set<std::uint64_t>& lines) const;
  std::set<std::uint64_t> lines_of_others() const;
  std::vector<std::string> lines() const;
  void write_own_line();

  std::filesystem::path file_;
  OwnedDescriptor open_;
  LockCall call_;
  bool has_locks_ = true;
  std::string missing_;
  std::unique_ptr<Leases> leases_;     // null: nobody has needed them here
  std::set<std::uint64_t> at_others_;  // frames, by the leases of their processes
  std::int64_t line_ = -1;             // of this process in the text; -1: none yet
  FolderUser self_;
};

}  // namespace previz::post
