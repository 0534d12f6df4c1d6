// One immutable value that a thread publishes and any other looks at.
#pragma once

#include <memory>
#include <mutex>
#include <utility>

namespace previz::pipeline {

template <class T>
class Newest {
 public:
  explicit Newest(T value) : value_(std::make_shared<const T>(std::move(value))) {}

  void set(T value) {
    auto next = std::make_shared<const T>(std::move(value));
    const std::lock_guard lock(mutex_);
    value_ = std::move(next);
  }
  std::shared_ptr<const T> get() const {
    const std::lock_guard lock(mutex_);
    return value_;
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const T> value_;
};

}  // namespace previz::pipeline
