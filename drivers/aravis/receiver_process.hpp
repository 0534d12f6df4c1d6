// The driver's side of the process that receives from one camera.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "drivers/aravis/child_process.hpp"
#include "drivers/aravis/protocol.hpp"
#include "drivers/descriptor.hpp"

namespace previz::aravis {

// What a receiver may reach.
enum class Reach { network, usb };

// Whatever the process sends, or does not send, the worst that follows is that it is ended, and
// gone() with a reason. No call waits longer than its deadline.
class ReceiverProcess {
 public:
  using Clock = std::chrono::steady_clock;

  // Starts the process. Throws previz::Error if it is not installed or cannot be started.
  explicit ReceiverProcess(Reach reach);
  // Starts another program in its place.
  ReceiverProcess(Reach reach, const std::filesystem::path& program);
  // Lets the process give its camera back in order, for two seconds at most.
  ~ReceiverProcess();
  ReceiverProcess(const ReceiverProcess&) = delete;
  ReceiverProcess& operator=(const ReceiverProcess&) = delete;

  bool gone() const { return !why_gone_.empty(); }
  const std::string& why_gone() const { return why_gone_; }
  pid_t pid() const { return process_->pid(); }

  // Sends a request and waits for its answer; what comes unasked meanwhile is kept for next().
  // Throws previz::Error if the request is refused or the process is gone by then.
  Message ask(Kind request, const Writer& body, std::chrono::milliseconds deadline,
              int descriptor = -1);
  // Sends what is not answered.
  void post(Kind kind, const Writer& body);
  // Returns what came unasked; none until then, or if the process is gone. A process that says
  // nothing for a second is ended.
  std::optional<Message> next(Clock::time_point until);

  // Ends a process that breaks the protocol.
  void give_up(const std::string& why);
  // Names the socket by which a network camera is controlled, and the camera's address. If the
  // process ends without giving the camera back, the camera would answer no other before its
  // heartbeat lapses, seconds later; so it is given back over this socket. Nothing is ever read
  // from it.
  void hold(OwnedDescriptor control_socket, std::uint32_t address);

 private:
  Received take(Message& message, Clock::time_point until);
  void release_camera();

  OwnedDescriptor socket_;
  std::unique_ptr<ChildProcess> process_;
  std::string why_gone_;
  std::deque<Message> unasked_;
  Clock::time_point heard_;
  OwnedDescriptor control_socket_;
  std::uint32_t address_ = 0;
};

// Returns text of foreign origin, in printable ASCII.
std::string printable(const std::string& text);

}  // namespace previz::aravis
