// What is worth a line to whoever runs the rig: each different one once, other figures in it or
// not.
#pragma once

#include <mutex>
#include <ostream>
#include <string>

#include "daemon/pipeline/news.hpp"

namespace previz::rig {

// From any thread.
class Notes {
 public:
  explicit Notes(std::ostream& out) : out_(out) {}
  void operator()(const std::string& note) {
    const std::lock_guard lock(mutex_);
    if (news_.is_new(note)) out_ << note << std::endl;
  }
  // Whether or not it was said before.
  void again(const std::string& note) {
    const std::lock_guard lock(mutex_);
    out_ << note << std::endl;
  }

 private:
  std::mutex mutex_;
  pipeline::News news_;
  std::ostream& out_;
};

}  // namespace previz::rig
