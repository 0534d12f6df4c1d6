// Packets of hosts that mean harm to the receiver of a network camera, and its process.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::test::hostile {

namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;

constexpr const char* address = "127.0.0.1";  // the camera's
constexpr const char* another = "127.0.0.9";

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
inline Bytes packet(std::uint8_t type, std::uint32_t number, std::uint16_t frame,
                    std::size_t rest) {
  Bytes bytes(8);
  put(bytes, 2, frame, 2);
  bytes[4] = type;
  put(bytes, 5, number, 3);
  bytes.resize(bytes.size() + rest, 0x41);
  return bytes;
}
inline Bytes extended(std::uint8_t type, std::uint32_t number, std::uint16_t frame,
                      std::size_t rest) {
  Bytes bytes(20);
  bytes[4] = static_cast<std::uint8_t>(0x80 | type);
  put(bytes, 14, frame, 2);
  put(bytes, 16, number, 4);
  bytes.resize(bytes.size() + rest, 0x41);
  return bytes;
}

// Returns what is no packet of this stream: short, empty, with numbers of packets that there are
// not, with parts and kinds that its pictures have not.
inline std::vector<Bytes> malformed() {
  std::vector<Bytes> all{{}};
  for (std::uint8_t type = 0; type <= 8; ++type) {
    for (const std::uint16_t frame : {std::uint16_t{9000}, std::uint16_t{40000}}) {
      for (const std::uint32_t number : {0u, 1u, 4u, 5u, 0x4000u, 0xfff000u, 0xffffffu}) {
        all.push_back(packet(type, number, frame, 0));
        all.push_back(packet(type, number, frame, 1400));
      }
      for (const std::uint32_t number : {0u, 1u, 5u, 0x7fffffffu, 0xfffffffeu, 0xffffffffu}) {
        all.push_back(extended(type, number, frame, 0));
        all.push_back(extended(type, number, frame, 1400));
      }
    }
    for (std::size_t size = 1; size < 20; ++size) {
      Bytes cut = extended(type, 0, 9001, 0);
      cut.resize(size);
      all.push_back(cut);
      cut[std::min<std::size_t>(4, size - 1)] = type;
      all.push_back(cut);
    }
  }
  Bytes parts = packet(1, 255, 9002, 12);  // a leader of 255 parts, of which none is there
  parts[10] = 0, parts[11] = 10;           // payload type: multipart
  all.push_back(parts);
  return all;
}

// Bytes that are no packet but by chance, of a kind that Aravis knows where they are long enough.
inline Bytes noise(std::mt19937& random) {
  Bytes bytes(random() % 60);
  std::ranges::generate(bytes, [&] { return static_cast<std::uint8_t>(random()); });
  if (bytes.size() > 4) bytes[4] = static_cast<std::uint8_t>(bytes[4] & 0x83);
  return bytes;
}

// An answer on the control channel that says that the answer takes so long.
inline Bytes pending(std::uint32_t ms) {
  Bytes bytes{0, 0, 0, 0x89, 0, 4, 0x12, 0x34, 0, 0, 0, 0};
  put(bytes, 8, ms, 4);
  return bytes;
}

}  // namespace previz::test::hostile
