#include "drivers/aravis/receiver/guarded_sockets.hpp"

#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <mutex>
#include <utility>

#include "drivers/aravis/receiver/gobject.hpp"
#include "drivers/aravis/receiver/packet_filter.hpp"
#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

// Libraries that know nothing of filters call socket(), so that what they get is kept for the whole
// process.
struct Admitted {
  std::mutex mutex;
  bpf::Program filter = bpf::verdict(0);
};
Admitted& admitted() {
  static Admitted one;
  return one;
}

// Closes the socket and returns -1 with errno if it cannot be filtered.
int filtered(int socket) {
  Admitted& now = admitted();
  const std::lock_guard lock(now.mutex);
  if (attach(socket, now.filter)) return socket;
  const int why = errno;
  close(socket);
  errno = why;
  return -1;
}

}  // namespace

void admit(bpf::Program filter) {
  Admitted& now = admitted();
  const std::lock_guard lock(now.mutex);
  now.filter = std::move(filter);
}

void check_that_sockets_are_filtered() {
  Failure failure;
  const Owned<GSocket> socket(g_socket_new(G_SOCKET_FAMILY_IPV4, G_SOCKET_TYPE_DATAGRAM,
                                           G_SOCKET_PROTOCOL_UDP, failure.out()));
  if (!socket) throw Error("its sockets cannot be filtered: " + failure.text());
  if (!is_filtered(g_socket_get_fd(socket.get())))
    throw Error("its sockets are not filtered, because this GLib does not call socket()");
}

}  // namespace previz::aravis

// Aravis makes and binds its sockets within calls (arv_camera_new, arv_camera_create_stream) that
// return when packets may have come already, so a filter that is attached afterwards comes too late
// for some. This definition stands before libc's for all libraries, since the dynamic linker looks
// into the program first. A socket has its filter before its maker knows its number, and receives
// nothing before its maker binds it, so that no packet passes unseen.
extern "C" __attribute__((visibility("default"))) int socket(int domain, int type,
                                                             int protocol) noexcept {
  const auto made = static_cast<int>(syscall(SYS_socket, domain, type, protocol));
  const bool is_udp = domain == AF_INET && (type & ~(SOCK_CLOEXEC | SOCK_NONBLOCK)) == SOCK_DGRAM;
  return made >= 0 && is_udp ? previz::aravis::filtered(made) : made;
}
