// Passes values between threads, through a mailbox (newest value only), a bounded queue (never
// drops), a queue of recent values (never waits), or a published value that stays.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

namespace previz::pipeline {

// Says how much waits in a queue, and for how long.
struct Waiting {
  std::uint64_t values = 0;
  double oldest_s = 0;      // for how long the oldest of them has waited
  std::uint64_t bytes = 0;  // 0 where the queue does not count bytes
};

// A value and when it was pushed.
template <class T>
struct Pushed {
  T value;
  std::chrono::steady_clock::time_point at = std::chrono::steady_clock::now();

  double age_s() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - at).count();
  }
};

// A channel has one writer and one reader; any thread may close it. Values are moved; share big
// ones by std::shared_ptr<const T>.
template <class T>
class Channel {
 public:
  virtual ~Channel() = default;

  // Returns false if the channel is closed: the value is gone and the writer should end.
  virtual bool push(T value) = 0;
  // Waits for a value. Returns nothing once the channel is closed and drained: the reader should
  // end.
  virtual std::optional<T> pop() = 0;
  // Returns the value that is there now, if any, without waiting.
  virtual std::optional<T> try_pop() = 0;
  // Ends pushing and wakes everybody who waits. Values inside can still be popped.
  virtual void close() = 0;
  // Closes the channel and throws away the values inside, for when another stage has failed and the
  // backlog is of no use.
  virtual void abandon() = 0;
  // Counts the values that were never popped because a newer one took their place.
  virtual std::uint64_t dropped() const = 0;
  virtual Waiting waiting() const = 0;
};

// What the channels share: the values wait in order, behind one lock. A class of its own says when
// there is room, and how much may wait.
template <class T>
class Queue : public Channel<T> {
 public:
  bool push(T value) override {
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return has_room() || closed_; });
      if (closed_) return false;
      put(std::move(value));
    }
    changed_.notify_all();
    return true;
  }

  std::optional<T> pop() override {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !values_.empty() || closed_; });
    return take(lock);
  }

  std::optional<T> try_pop() override {
    std::unique_lock lock(mutex_);
    return take(lock);
  }

  void close() override { close(false); }
  void abandon() override { close(true); }

  std::uint64_t dropped() const override {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }
  Waiting waiting() const override {
    const std::lock_guard lock(mutex_);
    if (values_.empty()) return {};
    return {.values = values_.size(), .oldest_s = values_.front().age_s(), .bytes = bytes_};
  }

 protected:
  // All of these are called under the lock.
  virtual bool has_room() const { return true; }       // else a push waits
  virtual bool has_too_much() const { return false; }  // then the oldest value is dropped
  virtual std::uint64_t bytes_of(const T&) const { return 0; }

  void put(T value) {
    bytes_ += bytes_of(value);
    values_.push_back({std::move(value)});
    while (has_too_much()) {
      take_first();
      ++dropped_;
    }
  }

  // Returns the oldest value, if any, and lets the lock go.
  std::optional<T> take(std::unique_lock<std::mutex>& lock) {
    if (values_.empty()) return std::nullopt;
    std::optional<T> value = take_first();
    lock.unlock();
    changed_.notify_all();
    return value;
  }

  mutable std::mutex mutex_;
  // With one writer and one reader, at most one of them waits: for room or for a value.
  std::condition_variable changed_;
  std::deque<Pushed<T>> values_;
  std::uint64_t bytes_ = 0;
  bool closed_ = false;

 private:
  T take_first() {
    T value = std::move(values_.front().value);
    values_.pop_front();
    bytes_ -= bytes_of(value);
    return value;
  }

  void close(bool empty) {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      if (empty) {
        values_.clear();
        bytes_ = 0;
      }
    }
    changed_.notify_all();
  }

  std::uint64_t dropped_ = 0;
};

// The channel for live use: a push replaces a value that was not taken yet and counts it as
// dropped. The writer never waits. The age of what waits is that of this value: of what it took the
// place of, nothing is known.
template <class T>
class Mailbox final : public Queue<T> {
 public:
  // Works like pop(), but also returns nothing once the time is over, for readers with other work.
  std::optional<T> pop_for(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [this] { return !values_.empty() || closed_; });
    return this->take(lock);
  }
  // Returns true once the channel is closed and drained: nothing will ever come.
  bool finished() const {
    const std::lock_guard lock(mutex_);
    return closed_ && values_.empty();
  }

 private:
  using Queue<T>::mutex_, Queue<T>::changed_, Queue<T>::values_, Queue<T>::closed_;

  bool has_too_much() const override { return values_.size() > 1; }
};

// The channel for recording and offline use: at most `capacity` (>= 1) values wait, in order; a
// push waits for room.
template <class T>
class BoundedQueue final : public Queue<T> {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  // Pushes without waiting. Returns false, and the value is gone, if there is no room or the
  // channel is closed.
  bool offer(T value) {
    {
      const std::lock_guard lock(mutex_);
      if (closed_ || values_.size() >= capacity_) return false;
      this->put(std::move(value));
    }
    changed_.notify_all();
    return true;
  }

 private:
  using Queue<T>::mutex_, Queue<T>::changed_, Queue<T>::values_, Queue<T>::closed_;

  bool has_room() const override { return values_.size() < capacity_; }

  const std::size_t capacity_;
};

// The channel for values that are all wanted, of a writer that must not wait: once more than
// `fewest` values wait that have more than `most_bytes` together, the oldest are dropped and
// counted.
template <class T>
class RecentQueue final : public Queue<T> {
 public:
  using BytesOf = std::function<std::uint64_t(const T&)>;
  RecentQueue(std::size_t fewest, std::uint64_t most_bytes, BytesOf bytes_of)
      : fewest_(fewest), most_bytes_(most_bytes), bytes_of_(std::move(bytes_of)) {}

 private:
  bool has_too_much() const override {
    return this->values_.size() > fewest_ && this->bytes_ > most_bytes_;
  }
  std::uint64_t bytes_of(const T& value) const override { return bytes_of_(value); }

  const std::size_t fewest_;
  const std::uint64_t most_bytes_;
  const BytesOf bytes_of_;
};

// Holds one immutable value that a thread publishes and any other thread reads.
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
