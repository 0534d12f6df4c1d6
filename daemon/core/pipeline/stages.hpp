// A stage is a thread with one input and one output; StageThreads runs them and ends them together.
#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/metrics.hpp"

namespace previz::pipeline {

// Every stage ends when its input ends (and then ends its output), so a stream's end runs through
// the whole line in order, and what was begun is finished. A stop ends the sources. An exception in
// any stage abandons every channel at once and calls `on_failure`, which must end sources that wait
// for something other than their channel. Channels must outlive this object.
class StageThreads {
 public:
  StageThreads(Metrics& metrics, std::stop_token stop, std::function<void()> on_failure = {})
      : metrics_(metrics), stop_(std::move(stop)), on_failure_(std::move(on_failure)) {}
  ~StageThreads() {
    abandon();
    join();
  }
  StageThreads(const StageThreads&) = delete;
  StageThreads& operator=(const StageThreads&) = delete;

  // Starts a source. `produce` is () -> std::optional<Out>; empty ends the stream. The time that it
  // waits is not counted as work.
  template <class Out, class Produce>
  void source(std::string name, Channel<Out>& output, Produce produce) {
    source(output, [this, name = std::move(name), produce = std::move(produce)]() mutable {
      std::optional<Out> value = produce();
      if (value) metrics_.worked(name, 0);
      return value;
    });
  }

  // Starts a source whose `produce` counts its own work.
  template <class Out, class Produce>
  void source(Channel<Out>& output, Produce produce) {
    know(output);
    start([this, &output, produce = std::move(produce)]() mutable {
      while (!stop_.stop_requested()) {
        std::optional<Out> value = produce();
        if (!value || !output.push(std::move(*value))) break;
      }
      output.close();
    });
  }

  // Starts a stage; `work` is (In) -> Out.
  template <class In, class Out, class Work>
  void stage(std::string name, Channel<In>& input, Channel<Out>& output, Work work) {
    know(input);
    know(output);
    start([this, name = std::move(name), &input, &output, work = std::move(work)]() mutable {
      Intake intake(metrics_, name, input);
      while (std::optional<In> value = input.pop()) {
        intake.update();
        const auto begin = std::chrono::steady_clock::now();
        Out result = work(std::move(*value));
        metrics_.worked(name, seconds_since(begin));
        if (!output.push(std::move(result))) break;
      }
      intake.update();
      output.close();
    });
  }

  // Starts a stage that looks ahead: `work` is (std::optional<In>) -> std::vector<Out>, what can be
  // passed on by now. It gets nothing once, when its input has ended, but not after a failure.
  template <class In, class Out, class Work>
  void stage_ahead(std::string name, Channel<In>& input, Channel<Out>& output, Work work) {
    know(input);
    know(output);
    start([this, name = std::move(name), &input, &output, work = std::move(work)]() mutable {
      Intake intake(metrics_, name, input);
      bool goes_on = true;
      while (goes_on) {
        std::optional<In> value = input.pop();
        intake.update();
        if (!value && is_abandoned()) break;
        goes_on = value.has_value();
        const auto begin = std::chrono::steady_clock::now();
        std::vector<Out> results = work(std::move(value));
        if (goes_on) metrics_.worked(name, seconds_since(begin));
        for (Out& result : results) goes_on = output.push(std::move(result)) && goes_on;
      }
      output.close();
    });
  }

  // Starts a sink; `consume` is (In) -> void.
  template <class In, class Consume>
  void sink(std::string name, Channel<In>& input, Consume consume) {
    know(input);
    start([this, name = std::move(name), &input, consume = std::move(consume)]() mutable {
      Intake intake(metrics_, name, input);
      while (std::optional<In> value = input.pop()) {
        intake.update();
        const auto begin = std::chrono::steady_clock::now();
        consume(std::move(*value));
        metrics_.worked(name, seconds_since(begin));
      }
      intake.update();
    });
  }

  // Waits for every stage to end, then rethrows the exception of the first stage that failed.
  void wait() {
    join();
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  }

 private:
  static double seconds_since(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

  template <class T>
  void know(Channel<T>& channel) {
    const std::lock_guard lock(mutex_);
    abandon_channel_.push_back([&channel] { channel.abandon(); });
    if (abandoned_) channel.abandon();
  }

  template <class Body>
  void start(Body body) {
    threads_.emplace_back([this, body = std::move(body)]() mutable {
      try {
        body();
      } catch (...) {
        {
          const std::lock_guard lock(mutex_);
          if (!failure_) failure_ = std::current_exception();
        }
        abandon();
        if (on_failure_) on_failure_();
      }
    });
  }

  void abandon() {
    const std::lock_guard lock(mutex_);
    abandoned_ = true;
    for (const auto& abandon_one : abandon_channel_) abandon_one();
  }

  bool is_abandoned() {
    const std::lock_guard lock(mutex_);
    return abandoned_;
  }

  void join() {
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }

  Metrics& metrics_;
  const std::stop_token stop_;
  const std::function<void()> on_failure_;
  std::mutex mutex_;
  std::vector<std::function<void()>> abandon_channel_;
  bool abandoned_ = false;
  std::exception_ptr failure_;
  std::vector<std::thread> threads_;
};

}  // namespace previz::pipeline
