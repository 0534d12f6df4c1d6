// Packets that the receiver of a network camera must not see, who sends them, and its process.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::test::hostile {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

constexpr const char* address = "127.0.0.1";  // the camera's
constexpr const char* another = "127.0.0.9";
constexpr std::uint16_t width = 64, height = 48;  // three packets, a leader and a trailer
constexpr std::uint16_t packet_size = 1500;
constexpr std::uint8_t forged = 0x41;         // every byte of a picture that is not the camera's
constexpr std::uint32_t too_much_ms = 5'000;  // longer than any call to the camera may take

// The processes that this one has started to receive from cameras.
inline std::vector<pid_t> receivers(pid_t parent = getpid()) {
  std::vector<pid_t> found;
  for (const fs::directory_entry& entry : fs::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "stat");
    std::string pid, name, state, of;
    if (file >> pid >> name >> state >> of && name.starts_with("(previzd-aravi") && state != "Z" &&
        (parent == 0 || std::stoi(of) == parent))
      found.push_back(std::stoi(pid));
  }
  return found;
}

inline bool is_running(pid_t pid) {
  return std::ranges::count(receivers(0), pid) > 0;
}

// The ports of this network's UDP sockets, but for the camera's control port.
inline std::vector<std::uint16_t> udp_ports() {
  std::vector<std::uint16_t> ports;
  std::ifstream file("/proc/thread-self/net/udp");
  std::string line;
  while (std::getline(file, line)) {
    const std::size_t colon = line.find(':', line.find(':') + 1);
    if (colon == std::string::npos || line.find("sl") != std::string::npos) continue;
    const auto port =
        static_cast<std::uint16_t>(std::stoul(line.substr(colon + 1, 4), nullptr, 16));
    if (port != 3956) ports.push_back(port);
  }
  return ports;
}

// Somebody who sends to every port there is.
class Sender {
 public:
  explicit Sender(const char* from) : socket_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    const sockaddr_in own = at(from, 0);
    if (bind(socket_.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0)
      throw Error(std::string("no socket at ") + from);
  }

  void send(const Bytes& bytes, const std::vector<std::uint16_t>& ports) const {
    for (const std::uint16_t port : ports) {
      const sockaddr_in to = at(address, port);
      sendto(socket_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT,
             reinterpret_cast<const sockaddr*>(&to), sizeof to);
    }
  }

 private:
  static sockaddr_in at(const char* ip, std::uint16_t port) {
    sockaddr_in socket_address{};
    socket_address.sin_family = AF_INET;
    socket_address.sin_port = htons(port);
    inet_pton(AF_INET, ip, &socket_address.sin_addr);
    return socket_address;
  }

  OwnedDescriptor socket_;
};

// Puts the lowest `size` bytes of a number at a place, the highest of them first.
inline void put(Bytes& bytes, std::size_t at, std::uint32_t number, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    bytes.at(at + i) = static_cast<std::uint8_t>(number >> 8 * (size - 1 - i));
}

// A packet of the streaming protocol with a header of 8 bytes, or of 20 with extended ids.
inline Bytes packet(bool extended, std::uint8_t type, std::uint32_t number, std::uint16_t frame,
                    const Bytes& body) {
  Bytes bytes(extended ? 20 : 8);
  bytes[4] = static_cast<std::uint8_t>(extended ? 0x80 | type : type);
  put(bytes, extended ? 14 : 2, frame, 2);
  put(bytes, extended ? 16 : 5, number, extended ? 4 : 3);
  bytes.insert(bytes.end(), body.begin(), body.end());
  return bytes;
}

// What a leader says of the camera's pictures.
inline Bytes picture_terms() {
  Bytes terms(36);
  put(terms, 2, 1, 2);             // a picture
  put(terms, 12, 0x0108'0001, 4);  // Mono8
  put(terms, 16, width, 4);
  put(terms, 20, height, 4);
  return terms;
}

// The packets of a whole picture of `forged` bytes, as the camera could send it.
inline std::vector<Bytes> whole_picture(bool extended, std::uint16_t frame) {
  std::vector<Bytes> packets{packet(extended, 1, 0, frame, picture_terms())};
  const std::size_t room = packet_size - 28 - (extended ? 20 : 8);  // without IPv4 and UDP
  std::size_t left = std::size_t{width} * height;
  std::uint32_t number = 1;
  for (; left > 0; ++number) {
    const Bytes part(std::min(left, room), forged);
    packets.push_back(packet(extended, 3, number, frame, part));
    left -= part.size();
  }
  Bytes end(8);
  put(end, 2, 1, 2);
  put(end, 4, height, 4);
  packets.push_back(packet(extended, 2, number, frame, end));
  return packets;
}

// Packets of a stream that has no such: each is whole, and Aravis would leave it out by itself.
inline std::vector<Bytes> out_of_place() {
  std::vector<Bytes> packets;
  for (const bool is_extended : {false, true}) {
    const auto frame = static_cast<std::uint16_t>(is_extended ? 20'000 : 10'000);
    packets.push_back(packet(is_extended, 1, 1, frame, picture_terms()));  // a leader is number 0
    packets.push_back(packet(is_extended, 3, 4, frame + 1, Bytes(1400, forged)));  // of 3
  }
  return packets;
}

// What a receiver must not see of such a host, although none of it would do Aravis any harm. In
// the camera's name nobody can be kept from sending whole pictures.
inline std::vector<Bytes> unwanted(const std::string& from) {
  std::vector<Bytes> packets = out_of_place();
  if (from == address) return packets;
  for (const bool is_extended : {false, true})
    for (Bytes& part : whole_picture(is_extended, is_extended ? 22'000 : 12'000))
      packets.push_back(std::move(part));
  return packets;
}

// An answer on the control channel that says that the answer takes so long.
inline Bytes pending(std::uint32_t ms) {
  Bytes bytes{0, 0, 0, 0x89, 0, 4, 0x12, 0x34, 0, 0, 0, 0};
  put(bytes, 8, ms, 4);
  return bytes;
}

}  // namespace previz::test::hostile
