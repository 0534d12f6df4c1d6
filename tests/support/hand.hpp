// Buttons that a thread of the test pushes.
#pragma once

#include <sys/eventfd.h>

#include "drivers/buttons.hpp"
#include "drivers/descriptor.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

class Hand {
 public:
  class Device final : public Buttons {
   public:
    explicit Device(Hand& hand) : hand_(hand) {}
    std::string name() const override { return "hand"; }
    int fd() const override { return hand_.descriptor_.get(); }
    std::optional<ButtonsEvent> next() override {
      const std::lock_guard lock(hand_.mutex_);
      eventfd_t ignored = 0;
      eventfd_read(fd(), &ignored);
      if (hand_.events_.empty()) return std::nullopt;
      ButtonsEvent event = hand_.events_.front();
      hand_.events_.pop_front();
      if (!hand_.events_.empty()) eventfd_write(fd(), 1);
      return event;
    }

   private:
    Hand& hand_;
  };

  void press(const std::string& button) {
    const std::lock_guard lock(mutex_);
    for (const bool pushed : {true, false}) events_.push_back({button, pushed, 0});
    eventfd_write(descriptor_.get(), 1);
  }

 private:
  std::mutex mutex_;
  std::deque<ButtonEvent> events_;
  OwnedDescriptor descriptor_{eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
};

}  // namespace previz::test
