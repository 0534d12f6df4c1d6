// A network with a camera and with hosts that mean harm: what they send, and who receives it.
#pragma once

#include <arpa/inet.h>
#include <arv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "drivers/camera_drivers.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"
#include "tests/devices/private_network.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::test {
namespace aravis_hostile_test {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::StartsWith;
using Bytes = std::vector<std::uint8_t>;
using Clock = std::chrono::steady_clock;

constexpr const char* address = "127.0.0.1";
constexpr const char* another = "127.0.0.9";
constexpr std::uint32_t url_register = 0x200;  // where a camera says where its description is
constexpr int width = 64, height = 48;         // three packets, a leader and a trailer

struct UnrefFake {
  void operator()(gpointer object) const { g_object_unref(object); }
};

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

// A packet of the streaming protocol with a header of 8 bytes, or of 20 with extended ids.
inline Bytes packet(std::uint8_t type, std::uint32_t number, std::uint16_t frame,
                    std::size_t rest) {
  Bytes bytes{0,
              0,
              static_cast<std::uint8_t>(frame >> 8),
              static_cast<std::uint8_t>(frame),
              type,
              static_cast<std::uint8_t>(number >> 16),
              static_cast<std::uint8_t>(number >> 8),
              static_cast<std::uint8_t>(number)};
  bytes.resize(bytes.size() + rest, 0x41);
  return bytes;
}
inline Bytes extended(std::uint8_t type, std::uint32_t number, std::uint16_t frame,
                      std::size_t rest) {
  Bytes bytes(20);
  bytes[4] = static_cast<std::uint8_t>(0x80 | type);
  bytes[14] = static_cast<std::uint8_t>(frame >> 8);
  bytes[15] = static_cast<std::uint8_t>(frame);
  for (int i = 0; i < 4; ++i) bytes[16 + i] = static_cast<std::uint8_t>(number >> (24 - 8 * i));
  bytes.resize(bytes.size() + rest, 0x41);
  return bytes;
}

// What is no packet of this camera's stream: short, empty, with numbers of packets that there are
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

// An answer on the control channel that says that the answer takes so long.
inline Bytes pending(std::uint32_t ms) {
  return {0,
          0,
          0,
          0x89,
          0,
          4,
          0x12,
          0x34,
          static_cast<std::uint8_t>(ms >> 24),
          static_cast<std::uint8_t>(ms >> 16),
          static_cast<std::uint8_t>(ms >> 8),
          static_cast<std::uint8_t>(ms)};
}

class HostileNetwork : public testing::Test {
 protected:
  void SetUp() override {
    const bool is_private = enter_private_network();  // the camera's control port is fixed
    plug();
    if (!fake_ && !is_private)
      GTEST_SKIP() << "Aravis' fake camera cannot listen on " << address
                   << ", and this process may have no network of its own";
    ASSERT_TRUE(fake_) << "Aravis' fake camera cannot listen on " << address;
  }
  void TearDown() override { EXPECT_EQ(std::to_string(receivers().size()), "0"); }

  void plug() {
    camera_.reset(arv_gv_fake_camera_new(address, "previz-hostile"));
    if (!arv_gv_fake_camera_is_running(camera_.get())) return;
    fake_ = arv_gv_fake_camera_get_fake_camera(camera_.get());
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_WIDTH, width);
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_HEIGHT, height);
  }

  static std::unique_ptr<Camera> open() {
    CameraSettings settings;
    settings.device = address;
    settings.rate_hz = 40;
    settings.exposure_s = 0.01;
    settings.packet_size = 1500;
    return camera_driver("aravis").open(settings);
  }

  // Takes a frame; false, with what was counted, if none comes within two seconds.
  static testing::AssertionResult takes_a_frame(Camera& camera) {
    for (const auto end = Clock::now() + seconds(2); Clock::now() < end;) {
      const CameraEvent event = camera.next(milliseconds(100));
      if (std::holds_alternative<FramePtr>(event)) return testing::AssertionSuccess();
      if (const auto* trouble = std::get_if<DeviceTrouble>(&event))
        return testing::AssertionFailure() << trouble->what;
    }
    return testing::AssertionFailure() << testing::PrintToString(camera.counters());
  }

  // Sends everything malformed while frames come, each at least once between two of them.
  static void expect_frames_among(const char* from) {
    const auto camera = open();
    camera->start();
    ASSERT_TRUE(takes_a_frame(*camera));
    const std::vector<pid_t> before = receivers();
    const std::vector<std::uint16_t> ports = udp_ports();
    const Sender sender(from);
    ASSERT_EQ(before.size(), 1u);
    ASSERT_GE(ports.size(), 2u);  // of the control channel and the stream
    const std::vector<Bytes> packets = malformed();
    for (std::size_t i = 0; i < packets.size(); ++i) {
      sender.send(packets[i], ports);
      if (i % 20 != 0) continue;
      ASSERT_TRUE(takes_a_frame(*camera)) << "after packet " << i;
    }
    std::mt19937 random(1);
    for (int i = 0; i < 20'000; ++i) {
      Bytes noise(random() % 60);
      std::ranges::generate(noise, [&] { return static_cast<std::uint8_t>(random()); });
      if (noise.size() > 4) noise[4] = static_cast<std::uint8_t>(noise[4] & 0x83);
      sender.send(noise, ports);
      if (i % 2000 != 0) continue;
      ASSERT_TRUE(takes_a_frame(*camera)) << "in the flood";
    }
    for (int i = 0; i < 5; ++i) EXPECT_TRUE(takes_a_frame(*camera));
    EXPECT_EQ(receivers(), before) << "the receiver was ended";
  }

  std::unique_ptr<ArvGvFakeCamera, UnrefFake> camera_;
  ArvFakeCamera* fake_ = nullptr;  // the camera's
  TemporaryDirectory directory_;
};

}  // namespace aravis_hostile_test
}  // namespace previz::test
