// Shares numbered things of a folder between machines whose file system has no locks that each
// other's see: who has number 7 has made the file LEASES/7, and renews its time as long as he
// lives.
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <thread>

namespace previz::post {

// Returns the time that the disk of a folder gives to a new file, in seconds since 1970. Throws
// previz::Error where none can be written.
std::int64_t time_of_disk_s(const std::filesystem::path& folder);

class Leases {
 public:
  // Makes the folder. Throws previz::Error, also where that is a link.
  explicit Leases(const std::filesystem::path& folder);
  // Gives back what is left, and removes what others left behind that died half an hour ago.
  ~Leases();
  Leases(const Leases&) = delete;
  Leases& operator=(const Leases&) = delete;

  // Takes a number; returns false if another process that is alive has it, or had it a moment ago.
  // What a dead one had is taken over, three minutes after its last sign of life: that takes two
  // seconds, until whoever did so at the same moment has told so. Throws previz::Error where no
  // file can be made.
  bool take(std::uint64_t number);
  void give_back(std::uint64_t number);
  // Returns how far this machine's clock is behind that of the disk.
  std::int64_t behind_s() const { return behind_s_; }

 private:
  std::filesystem::path file(std::uint64_t number) const;
  bool make(std::uint64_t number) const;
  bool is_mine(std::uint64_t number) const;
  bool remove_dead(std::uint64_t number) const;
  void renew();

  const std::filesystem::path folder_;
  const std::string name_;  // of this object, in its files
  std::int64_t behind_s_ = 0;
  std::mutex mutex_;
  std::set<std::uint64_t> own_;
  std::jthread signs_;  // the last: it uses all others
};

// Returns the numbers from `begin` on, and below `end`, that processes which are alive have taken,
// among them those of this process, by a clock that is so many seconds behind that of the disk.
// Makes no file.
std::set<std::uint64_t> leased(const std::filesystem::path& folder, std::uint64_t begin,
                               std::uint64_t end, std::int64_t behind_s);

}  // namespace previz::post
