// Hands over what libcamera's thread reports of a camera. Not for use outside the driver.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>

namespace libcamera {
class Request;
}

namespace previz::libcam {

// A signal of libcamera 0.0.3 may be disconnected only while nobody emits it. A mailbox is
// therefore never disconnected. The camera's signals own it, and every opening of the same camera
// uses the same one.
class Mailbox {
 public:
  // Accepts requests that come back from now on.
  void open() {
    const std::lock_guard lock(mutex_);
    is_open_ = true;
  }
  // Forgets requests that came back, and those that still will.
  void close() {
    const std::lock_guard lock(mutex_);
    is_open_ = false;
    done_.clear();
  }
  bool unplugged() const {
    const std::lock_guard lock(mutex_);
    return unplugged_;
  }
  // Returns the next request that came back; null after the time-out, or if the camera is gone.
  ::libcamera::Request* wait(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, timeout, [this] { return unplugged_ || !done_.empty(); });
    if (unplugged_ || done_.empty()) return nullptr;
    ::libcamera::Request* request = done_.front();
    done_.pop_front();
    return request;
  }

  // These two run on libcamera's thread.
  void completed(::libcamera::Request* request) {
    const std::lock_guard lock(mutex_);
    if (!is_open_) return;
    done_.push_back(request);
    wake_.notify_one();
  }
  void disconnected() {
    const std::lock_guard lock(mutex_);
    unplugged_ = true;
    wake_.notify_one();
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool is_open_ = false, unplugged_ = false;
  std::deque<::libcamera::Request*> done_;
};

// Returns the camera's mailbox, which is made when the camera is opened for the first time. A
// camera that was unplugged and is back is another camera to libcamera. `Camera` is libcamera's, or
// that of a test with the same two signals.
template <typename Camera>
std::shared_ptr<Mailbox> mailbox_of(const std::shared_ptr<Camera>& camera) {
  static std::mutex mutex;
  static std::map<std::weak_ptr<Camera>, std::weak_ptr<Mailbox>, std::owner_less<>> mailboxes;
  const std::lock_guard lock(mutex);
  std::erase_if(mailboxes, [](const auto& entry) { return entry.first.expired(); });
  if (const auto found = mailboxes.find(camera); found != mailboxes.end())
    return found->second.lock();
  auto mailbox = std::make_shared<Mailbox>();
  camera->requestCompleted.connect(
      mailbox.get(), [mailbox](::libcamera::Request* request) { mailbox->completed(request); });
  camera->disconnected.connect(mailbox.get(), [mailbox] { mailbox->disconnected(); });
  mailboxes.emplace(camera, mailbox);
  return mailbox;
}

}  // namespace previz::libcam
