#pragma once

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "drivers/descriptor.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::test {

// systemd's end of the notification socket, which is always read: whoever writes would else wait.
class NotifySocket {
 public:
  using Heard = std::function<void(const std::string& message)>;
  // `heard` gets every message as it comes, on a thread of its own.
  explicit NotifySocket(
      const std::filesystem::path& path,
      std::chrono::microseconds watchdog = std::chrono::milliseconds(200),
      Heard heard = [](const std::string&) {})
      : descriptor_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)), heard_(std::move(heard)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(bind(descriptor_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    thread_ = std::jthread([this](const std::stop_token& stop) { listen(stop); });
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
    setenv("WATCHDOG_USEC", std::to_string(watchdog.count()).c_str(), 1);
  }
  ~NotifySocket() {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
  }
  // The next message; empty where none came within the time.
  std::string next(int milliseconds) {
    std::unique_lock lock(mutex_);
    news_.wait_for(lock, std::chrono::milliseconds(milliseconds), [&] { return !said_.empty(); });
    if (said_.empty()) return "";
    std::string first = std::move(said_.front());
    said_.pop_front();
    return first;
  }
  void skip() {
    while (!next(0).empty()) continue;
  }
  // Returns how often the watchdog was fed within this time.
  int fed_within(std::chrono::milliseconds time) {
    int fed = 0;
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end)
      fed += next(50).find("WATCHDOG=1") != std::string::npos ? 1 : 0;
    return fed;
  }
  void until(const std::string& words) {
    for (std::string said = next(60'000); said.find(words) == std::string::npos;
         said = next(60'000))
      if (said.empty()) throw WaitedInVain("systemd is not sent " + words);
  }

 private:
  void listen(const std::stop_token& stop) {
    const std::stop_callback wake(stop, [this] { eventfd_write(end_.get(), 1); });
    std::array<pollfd, 2> both{{{descriptor_.get(), POLLIN, 0}, {end_.get(), POLLIN, 0}}};
    while (poll(both.data(), both.size(), -1) > 0 && both[1].revents == 0) {
      std::array<char, 4096> text{};
      const ssize_t size = recv(descriptor_.get(), text.data(), text.size(), 0);
      const std::string message(text.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
      heard_(message);
      const std::lock_guard lock(mutex_);
      said_.push_back(message);
      news_.notify_all();
    }
  }

  OwnedDescriptor descriptor_, end_{eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)};
  const Heard heard_;
  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<std::string> said_;
  std::jthread thread_;
};

}  // namespace previz::test
