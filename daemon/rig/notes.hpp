// What is worth a line to whoever runs the rig: each different one once.
#pragma once

#include <mutex>
#include <ostream>
#include <set>
#include <string>

namespace previz::rig {

// From any thread.
class Notes {
 public:
  explicit Notes(std::ostream& out) : out_(out) {}
  void operator()(const std::string& note) {
    const std::lock_guard lock(mutex_);
    if (told_.insert(note).second) out_ << note << std::endl;
  }
  // Whether or not it was said before.
  void again(const std::string& note) {
    const std::lock_guard lock(mutex_);
    out_ << note << std::endl;
  }

 private:
  std::mutex mutex_;
  std::set<std::string> told_;
  std::ostream& out_;
};

}  // namespace previz::rig
