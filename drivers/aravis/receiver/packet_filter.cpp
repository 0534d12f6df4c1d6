#include "drivers/aravis/receiver/packet_filter.hpp"

#include <netinet/in.h>
#include <sys/socket.h>

#include <string>

#include "drivers/error.hpp"

namespace previz::aravis {
namespace {

using bpf::all;
using bpf::load;
using bpf::mask;
using bpf::Program;
using bpf::verdict;
using bpf::when;
using bpf::when_not;

// A socket's filter sees a datagram from its UDP header on.
constexpr std::uint32_t udp = 8;

const Program drop = verdict(0), pass = verdict(0xffffffff);

Program only_from(std::uint32_t camera) {
  const auto source = static_cast<std::uint32_t>(SKF_NET_OFF + 12);  // in the IPv4 header
  return all({load(BPF_W, source), when_not(BPF_JEQ, camera, drop)});
}

// The rules for packets with a header of 8 bytes, or, with extended ids, of 20 (GigE Vision 2.0,
// 24.2: status, block id, format, packet id).
Program stream_rules(bool extended, std::int64_t packet_size, std::int64_t payload) {
  const std::uint32_t header = extended ? 20 : 8;
  const std::int64_t room = packet_size - 28 - header;  // without IPv4 and UDP
  if (room < 1)
    throw Error("its packets of " + std::to_string(packet_size) +
                " bytes are too small for any data");
  const auto most = static_cast<std::uint32_t>((payload + room - 1) / room);
  const Program number =
      extended ? load(BPF_W, udp + 16) : all({load(BPF_W, udp + 4), mask(0x00ffffff)});
  const Program payload_type = all({load(BPF_H, udp + header + 2), mask(0x3fff)});
  // The last byte of what a leader of a picture must have is read, which drops a shorter one.
  const Program leader = all({number, when_not(BPF_JEQ, 0, drop), payload_type,
                              when(BPF_JEQ, 4, all({load(BPF_B, udp + header + 11), pass})),
                              when(BPF_JEQ, 1, all({load(BPF_B, udp + header + 35), pass})),
                              when(BPF_JEQ, 5, all({load(BPF_B, udp + header + 35), pass})), drop});
  const auto numbered_to = [&](std::uint32_t last) {
    return all({number, when_not(BPF_JGE, 1, drop), when(BPF_JGT, last, drop), pass});
  };
  return all({load(BPF_B, udp + 4), mask(0x7f), when(BPF_JEQ, 1, leader),
              when(BPF_JEQ, 2, numbered_to(most + 1)), when(BPF_JEQ, 3, numbered_to(most)), drop});
}

}  // namespace

Program stream_filter(std::uint32_t camera, std::int64_t packet_size, std::int64_t payload) {
  const Program extended = stream_rules(true, packet_size, payload);
  return all({only_from(camera), load(BPF_B, udp + 7), load(BPF_B, udp + 4),
              when(BPF_JSET, 0x80, extended), stream_rules(false, packet_size, payload)});
}

Program control_filter(std::uint32_t camera) {
  const Program patience = all({load(BPF_W, udp + 8), when(BPF_JGT, 1000, drop), pass});
  return all({only_from(camera), load(BPF_B, udp + 7), load(BPF_H, udp + 2),
              when(BPF_JEQ, 0x0089, patience), pass});
}

// A DISCOVERY_ACK of GigE Vision 2.0 has a header of 8 bytes and 248 about the camera.
Program discovery_filter() {
  constexpr std::uint32_t header = 8, announced = 248;
  return all({load(BPF_B, udp + header + announced - 1), load(BPF_H, udp + 2),
              when_not(BPF_JEQ, 0x0003, drop), pass});
}

bool attach(int socket, const Program& filter) {
  Program copy = filter;  // the kernel's interface asks for what it could write to
  const sock_fprog program{static_cast<unsigned short>(copy.size()), copy.data()};
  const int locked = 1;
  return setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) == 0 &&
         setsockopt(socket, SOL_SOCKET, SO_LOCK_FILTER, &locked, sizeof locked) == 0;
}

bool is_filtered(int socket) {
  int locked = 0;
  socklen_t size = sizeof locked;
  return getsockopt(socket, SOL_SOCKET, SO_LOCK_FILTER, &locked, &size) == 0 && locked == 1;
}

int udp_socket(std::uint16_t port) {
  constexpr int most_descriptors = 256;  // limit_resources() allows no more
  for (int descriptor = 0; descriptor < most_descriptors; ++descriptor) {
    int type = 0;
    socklen_t size = sizeof type;
    sockaddr_in own{};
    if (getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM)
      continue;
    size = sizeof own;
    if (getsockname(descriptor, reinterpret_cast<sockaddr*>(&own), &size) != 0 ||
        own.sin_family != AF_INET)
      continue;
    if (port == 0 || own.sin_port == htons(port)) return descriptor;
  }
  return -1;
}

}  // namespace previz::aravis
