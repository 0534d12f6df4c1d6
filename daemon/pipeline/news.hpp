// What is worth telling a user during a take.
#pragma once

#include <algorithm>
#include <iterator>
#include <set>
#include <string>

namespace previz::pipeline {

// Not thread-safe.
class News {
 public:
  // False where the same was asked before, other figures in it or not: what changes with every
  // frame is told once.
  bool is_new(const std::string& note) {
    std::string words;
    std::ranges::remove_copy_if(note, std::back_inserter(words),
                                [](char c) { return c >= '0' && c <= '9'; });
    return told_.insert(std::move(words)).second;
  }

 private:
  std::set<std::string> told_;
};

}  // namespace previz::pipeline
