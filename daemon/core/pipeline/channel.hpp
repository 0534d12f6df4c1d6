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

// The channel for live use: a push replaces a value that was not taken yet and counts it as
// dropped. The writer never waits.
template <class T>
class Mailbox final : public Channel<T> {
 public:
  bool push(T value) override {
    {
      const std::lock_guard lock(mutex_);
      if (closed_) return false;
      if (value_) ++dropped_;
      value_.emplace(Pushed<T>{std::move(value)});
    }
    filled_.notify_one();
    return true;
  }

  std::optional<T> pop() override {
    std::unique_lock lock(mutex_);
    filled_.wait(lock, [this] { return value_ || closed_; });
    return take();
  }

  std::optional<T> try_pop() override {
    const std::lock_guard lock(mutex_);
    return take();
  }

  // Works like pop(), but also returns nothing once the time is over, for readers with other work.
  std::optional<T> pop_for(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    filled_.wait_for(lock, timeout, [this] { return value_ || closed_; });
    return take();
  }
  // Returns true once the channel is closed and drained: nothing will ever come.
  bool finished() const {
    const std::lock_guard lock(mutex_);
    return closed_ && !value_;
  }

  void close() override { close(false); }
  void abandon() override { close(true); }

  std::uint64_t dropped() const override {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }
  // The age is that of the value that waits: of what it took the place of, nothing is known.
  Waiting waiting() const override {
    const std::lock_guard lock(mutex_);
    return value_ ? Waiting{.values = 1, .oldest_s = value_->age_s()} : Waiting{};
  }

 private:
  std::optional<T> take() {
    if (!value_) return std::nullopt;
    std::optional<T> value = std::move(value_->value);
    value_.reset();
    return value;
  }

  void close(bool empty) {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      if (empty) value_.reset();
    }
    filled_.notify_all();
  }

  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::optional<Pushed<T>> value_;
  std::uint64_t dropped_ = 0;
  bool closed_ = false;
};

// The channel for recording and offline use: at most `capacity` (>= 1) values wait, in order; a
// push waits for room.
template <class T>
class BoundedQueue final : public Channel<T> {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  bool push(T value) override {
    {
      std::unique_lock lock(mutex_);
      room_.wait(lock, [this] { return values_.size() < capacity_ || closed_; });
      if (closed_) return false;
      values_.push_back({std::move(value)});
    }
    filled_.notify_one();
    return true;
  }

  // Pushes without waiting. Returns false, and the value is gone, if there is no room or the
  // channel is closed.
  bool offer(T value) {
    {
      const std::lock_guard lock(mutex_);
      if (closed_ || values_.size() >= capacity_) return false;
      values_.push_back({std::move(value)});
    }
    filled_.notify_one();
    return true;
  }

  std::optional<T> pop() override {
    std::unique_lock lock(mutex_);
    filled_.wait(lock, [this] { return !values_.empty() || closed_; });
    return take(lock);
  }

  std::optional<T> try_pop() override {
    std::unique_lock lock(mutex_);
    return take(lock);
  }

  void close() override { close(false); }
  void abandon() override { close(true); }

  std::uint64_t dropped() const override { return 0; }
  Waiting waiting() const override {
    const std::lock_guard lock(mutex_);
    if (values_.empty()) return {};
    return {.values = values_.size(), .oldest_s = values_.front().age_s()};
  }

 private:
  std::optional<T> take(std::unique_lock<std::mutex>& lock) {
    if (values_.empty()) return std::nullopt;
    std::optional<T> value = std::move(values_.front().value);
    values_.pop_front();
    lock.unlock();
    room_.notify_one();
    return value;
  }

  void close(bool empty) {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      if (empty) values_.clear();
    }
    filled_.notify_all();
    room_.notify_all();
  }

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable filled_, room_;
  std::deque<Pushed<T>> values_;
  bool closed_ = false;
};

// The channel for values that are all wanted, of a writer that must not wait: once more than
// `fewest` values wait that have more than `most_bytes` together, the oldest are dropped and
// counted.
template <class T>
class RecentQueue final : public Channel<T> {
 public:
  using BytesOf = std::function<std::uint64_t(const T&)>;
  RecentQueue(std::size_t fewest, std::uint64_t most_bytes, BytesOf bytes_of)
      : fewest_(fewest), most_bytes_(most_bytes), bytes_of_(std::move(bytes_of)) {}

  bool push(T value) override {
    {
      const std::lock_guard lock(mutex_);
      if (closed_) return false;
      bytes_ += bytes_of_(value);
      values_.push_back({std::move(value)});
      while (values_.size() > fewest_ && bytes_ > most_bytes_) {
        take_first();
        ++dropped_;
      }
    }
    filled_.notify_one();
    return true;
  }

  std::optional<T> pop() override {
    std::unique_lock lock(mutex_);
    filled_.wait(lock, [this] { return !values_.empty() || closed_; });
    return take_first();
  }

  std::optional<T> try_pop() override {
    const std::lock_guard lock(mutex_);
    return take_first();
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

 private:
  std::optional<T> take_first() {
    if (values_.empty()) return std::nullopt;
    std::optional<T> value = std::move(values_.front().value);
    values_.pop_front();
    bytes_ -= bytes_of_(*value);
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
    filled_.notify_all();
  }

  const std::size_t fewest_;
  const std::uint64_t most_bytes_;
  const BytesOf bytes_of_;
  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::deque<Pushed<T>> values_;
  std::uint64_t bytes_ = 0, dropped_ = 0;
  bool closed_ = false;
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
