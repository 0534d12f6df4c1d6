#include "drivers/aravis/protocol.hpp"

#include <sys/socket.h>

#include <array>
#include <cerrno>

namespace previz::aravis {

bool send(int socket, Kind kind, const Writer& body, int descriptor, bool may_wait) {
  if (body.bytes().size() > most_message) return false;
  std::array<iovec, 2> parts{
      {{&kind, sizeof kind},
       {const_cast<std::uint8_t*>(body.bytes().data()), body.bytes().size()}}};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr header{};
  header.msg_iov = parts.data();
  header.msg_iovlen = parts.size();
  if (descriptor >= 0) {
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    cmsghdr* rights = CMSG_FIRSTHDR(&header);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(sizeof descriptor);
    std::memcpy(CMSG_DATA(rights), &descriptor, sizeof descriptor);
  }
  const int flags = MSG_NOSIGNAL | (may_wait ? 0 : MSG_DONTWAIT);
  ssize_t sent = 0;
  do sent = sendmsg(socket, &header, flags);
  while (sent < 0 && errno == EINTR);
  return sent >= 0;
}

Received receive(int socket, Message& message) {
  std::array<std::uint8_t, most_message> bytes;
  std::uint32_t kind = 0;
  std::array<iovec, 2> parts{{{&kind, sizeof kind}, {bytes.data(), bytes.size()}}};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr header{};
  header.msg_iov = parts.data();
  header.msg_iovlen = parts.size();
  header.msg_control = control.data();
  header.msg_controllen = CMSG_LEN(sizeof(int));  // with its padding, two descriptors would fit
  ssize_t size = 0;
  do size = recvmsg(socket, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  while (size < 0 && errno == EINTR);
  if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return Received::nothing;
  if (size < 0) return Received::closed;
  message.descriptor = {};
  const cmsghdr* rights = CMSG_FIRSTHDR(&header);
  if (rights && rights->cmsg_level == SOL_SOCKET && rights->cmsg_type == SCM_RIGHTS &&
      rights->cmsg_len == CMSG_LEN(sizeof(int))) {
    int descriptor = -1;
    std::memcpy(&descriptor, CMSG_DATA(rights), sizeof descriptor);
    message.descriptor = OwnedDescriptor(descriptor);
  }
  // An end of the stream has no bytes, a message at least its kind.
  if (static_cast<std::size_t>(size) < sizeof kind) return Received::closed;
  message.kind = static_cast<Kind>(kind);
  message.bytes.assign(bytes.begin(), bytes.begin() + (size - static_cast<ssize_t>(sizeof kind)));
  return Received::message;
}

}  // namespace previz::aravis
