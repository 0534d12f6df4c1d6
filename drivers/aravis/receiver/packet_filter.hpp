// Lets the kernel drop the packets that Aravis must not see: those of other hosts than the camera,
// and those that are not as the camera's streams and answers have to be.
#pragma once

#include <cstddef>
#include <cstdint>

#include "drivers/box/bpf.hpp"

namespace previz::aravis {

// Lets pass the packets of a stream that come from `camera` (IPv4, host order) and are what the
// GigE Vision streaming protocol allows for pictures of `payload` bytes in packets of `packet_size`
// bytes: leaders that are whole, payload that lies within the picture, and trailers. Throws
// previz::Error if such packets hold nothing.
bpf::Program stream_filter(std::uint32_t camera, std::int64_t packet_size, std::int64_t payload);

// Lets pass answers of `camera` on the control channel. An answer that asks for more patience than
// a second (PENDING_ACK) is dropped.
bpf::Program control_filter(std::uint32_t camera);

// Lets pass what answers a search for cameras, from whomever: whole announcements
// (DISCOVERY_ACK).
bpf::Program discovery_filter();

// Puts a filter on a UDP socket for good. Returns false, with errno, if the kernel refuses.
bool attach(int socket, const bpf::Program& filter);
bool is_filtered(int socket);

// Returns the UDP socket of this process with that port, or, with port 0, the first that there is;
// -1 if there is none. Aravis does not say which sockets it has.
int udp_socket(std::uint16_t port);

}  // namespace previz::aravis
