// Something that may wait for a disk, done on a thread of its own that nobody has to wait for.
#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <thread>
#include <utility>

namespace previz::rig {

// Returns what `work` will return or throw. Unlike that of std::async, the future may be dropped
// before: the work then goes on alone, so that it must own all that it uses. Throws
// std::system_error where there is no thread for it.
template <typename Result>
std::future<Result> sent_off(std::function<Result()> work) {
  std::promise<Result> promise;
  std::future<Result> result = promise.get_future();
  std::thread([promise = std::move(promise), work = std::move(work)]() mutable {
    try {
      promise.set_value(work());
    } catch (...) {
      promise.set_exception(std::current_exception());
    }
  }).detach();
  return result;
}

}  // namespace previz::rig
