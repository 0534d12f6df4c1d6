#include "drivers/aravis/receiver_process.hpp"

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

// The process says five times a second that it is alive.
constexpr milliseconds longest_silence{1000};
constexpr milliseconds time_to_end{2000};
// Frames are bounded by the buffers there are, pulses by the time an answer takes.
constexpr std::size_t most_unasked = 256;

// The program is in libexec/previzd of the folder that this program is in, or of one of the three
// above it: /usr/bin and /usr/libexec where it is installed, and so in a build's folder.
fs::path receiver_program() {
  std::error_code none;
  const fs::path own = fs::read_symlink("/proc/self/exe", none);
  fs::path folder = own.parent_path();
  for (int i = 0; i < 4 && !folder.empty(); ++i, folder = folder.parent_path()) {
    fs::path program = folder / "libexec" / "previzd" / "previzd-aravis";
    if (fs::is_regular_file(program, none)) return program;
  }
  throw Error("libexec/previzd/previzd-aravis, which receives from aravis cameras, is not beside " +
              own.string());
}

// Returns milliseconds for poll(), which end after `until`, not before.
int time_left(ReceiverProcess::Clock::time_point until) {
  const auto left = std::chrono::ceil<milliseconds>(until - ReceiverProcess::Clock::now());
  return static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 60'000));
}

// Returns why a process that has ended could not begin.
std::optional<std::string> last_words(int socket) {
  Message message;
  while (receive(socket, message) == Received::message)
    if (message.kind == Kind::refused)
      if (const auto why = body_of<std::string>(message)) return "refuses: " + printable(*why);
  return std::nullopt;
}

}  // namespace

ReceiverProcess::ReceiverProcess(Reach reach) : ReceiverProcess(reach, receiver_program()) {}

ReceiverProcess::ReceiverProcess(Reach reach, const fs::path& program) : heard_(Clock::now()) {
  std::array<int, 2> ends{-1, -1};
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw Error(std::string("cannot create a socket for a receiver: ") + std::strerror(errno));
  socket_ = OwnedDescriptor(ends[0]);
  OwnedDescriptor its_end(ends[1]);
  process_ = std::make_unique<ChildProcess>(
      program,
      std::vector<std::string>{reach == Reach::usb ? "usb" : "network", PREVIZ_RECEIVER_MESSAGES},
      std::move(its_end));
}

ReceiverProcess::~ReceiverProcess() {
  if (gone()) return;
  shutdown(socket_.get(), SHUT_RDWR);
  if (process_->ends_within(time_to_end)) return;
  process_->end();
  release_camera();
}

Message ReceiverProcess::ask(Kind request, const Writer& body, milliseconds deadline,
                             int descriptor) {
  const Clock::time_point until = Clock::now() + deadline;
  if (!gone() && !send(socket_.get(), request, body, descriptor, false))
    give_up(last_words(socket_.get()).value_or("accepts no requests"));
  Message message;
  while (!gone()) {
    const Received received = take(message, until);
    if (received == Received::closed) break;
    if (received == Received::nothing) {
      give_up("has not responded for " + std::to_string(deadline.count()) + " ms");
    } else if (message.kind == Kind::done) {
      return message;
    } else if (message.kind == Kind::refused) {
      const std::optional<std::string> why = body_of<std::string>(message);
      throw Error(why ? printable(*why) : "was refused without a reason");
    } else if (unasked_.size() == most_unasked) {
      give_up("sends too many messages");
    } else if (Clock::now() >= until) {
      give_up("has sent no answer, only other messages, for " + std::to_string(deadline.count()) +
              " ms");
    } else {
      if (message.kind == Kind::pulse)  // only the newest is of use
        std::erase_if(unasked_, [](const Message& m) { return m.kind == Kind::pulse; });
      unasked_.push_back(std::move(message));
      message = {};
    }
  }
  throw Error(why_gone_);
}

void ReceiverProcess::post(Kind kind, const Writer& body) {
  if (!gone() && !send(socket_.get(), kind, body, -1, false)) give_up("accepts no messages");
}

std::optional<Message> ReceiverProcess::next(Clock::time_point until) {
  Message message;
  if (!unasked_.empty()) {
    message = std::move(unasked_.front());
    unasked_.pop_front();
    return message;
  }
  if (gone()) return std::nullopt;
  if (take(message, std::min(until, heard_ + longest_silence)) == Received::message) {
    if (message.kind == Kind::frame || message.kind == Kind::pulse || message.kind == Kind::lost)
      return message;
    give_up("sends an unexpected answer");
  } else if (!gone() && Clock::now() >= heard_ + longest_silence) {
    give_up("has sent nothing for " + std::to_string(longest_silence.count()) + " ms");
  }
  return std::nullopt;
}

// What lies in the socket is taken even after `until`.
Received ReceiverProcess::take(Message& message, Clock::time_point until) {
  for (;;) {
    const Received received = receive(socket_.get(), message);
    if (received == Received::message) heard_ = Clock::now();
    if (message.kind != Kind::done) message.descriptor = {};  // nothing else brings one
    // The kernel reports the reset by a process that ended with a request unread before its words.
    if (received == Received::closed) give_up(last_words(socket_.get()).value_or("is gone"));
    if (received != Received::nothing || Clock::now() >= until) return received;
    pollfd readable{socket_.get(), POLLIN, 0};
    poll(&readable, 1, time_left(until));
  }
}

// A process that has closed its socket is about to end by itself, and how it ends says more.
void ReceiverProcess::give_up(const std::string& why) {
  if (gone()) return;
  const bool closed = why == "is gone" || why.starts_with("refuses: ");
  const bool ended = process_->ends_within(milliseconds(closed ? 100 : 0));
  const std::string end = process_->end();
  why_gone_ = "its receiving process " + why + (ended ? ": " + end : "");
  socket_ = {};
  release_camera();
}

void ReceiverProcess::hold(OwnedDescriptor control_socket, std::uint32_t address) {
  int domain = 0, type = 0;
  socklen_t size = sizeof domain;
  const int socket = control_socket.get();
  if (getsockopt(socket, SOL_SOCKET, SO_DOMAIN, &domain, &size) != 0 || domain != AF_INET ||
      getsockopt(socket, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM)
    return;
  control_socket_ = std::move(control_socket);
  address_ = address;
}

// GigE Vision 2.0, 14.3: WRITEREG without acknowledge, of 0 to the control channel privilege.
void ReceiverProcess::release_camera() {
  if (!control_socket_) return;
  constexpr std::array<std::uint8_t, 16> release{0x42, 0, 0,    0x82, 0, 8, 0xff, 0xff,
                                                 0,    0, 0x0a, 0,    0, 0, 0,    0};
  sockaddr_in camera{};
  camera.sin_family = AF_INET;
  camera.sin_port = htons(3956);
  camera.sin_addr.s_addr = htonl(address_);
  sendto(control_socket_.get(), release.data(), release.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
         reinterpret_cast<const sockaddr*>(&camera), sizeof camera);
  control_socket_ = {};
}

std::string printable(const std::string& text) {
  std::string safe = text;
  std::ranges::replace_if(
      safe, [](char c) { return c < ' ' || c > '~'; }, '?');
  return safe;
}

}  // namespace previz::aravis
