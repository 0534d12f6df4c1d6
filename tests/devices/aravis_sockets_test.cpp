// The sockets of a receiving process have their packet filters before they can receive: seen on the
// sockets themselves, while nothing answers, and in a flood that never pauses.
#include <linux/filter.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "drivers/aravis/protocol.hpp"
#include "drivers/aravis/receiver_process.hpp"
#include "drivers/aravis/shared_buffers.hpp"
#include "tests/devices/hostile_network.hpp"
#include "tests/support/test.hpp"

namespace previz::test::aravis_sockets_test {

using namespace aravis_hostile_test;

// What the kernel says of the bound UDP sockets of another process.
struct Sockets {
  int seen = 0;     // looked at while they were bound, however often
  int open = 0;     // of these: without a filter, or with one that can be taken off
  int refused = 0;  // descriptors of sockets that this process may not look at
};

void look(pid_t pid, Sockets& sockets) {
  const OwnedDescriptor process(static_cast<int>(syscall(SYS_pidfd_open, pid, 0)));
  for (int number = 0; process && number < 32; ++number) {
    const OwnedDescriptor socket(
        static_cast<int>(syscall(SYS_pidfd_getfd, process.get(), number, 0)));
    if (!socket) {
      sockets.refused += errno == EPERM;
      continue;
    }
    int type = 0, locked = 0;
    socklen_t size = sizeof type;
    sockaddr_in own{};
    if (getsockopt(socket.get(), SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM)
      continue;
    size = sizeof own;
    if (getsockname(socket.get(), reinterpret_cast<sockaddr*>(&own), &size) != 0 ||
        own.sin_family != AF_INET || own.sin_port == 0)
      continue;
    size = 0;  // asks for the number of instructions
    const bool has_none =
        getsockopt(socket.get(), SOL_SOCKET, SO_GET_FILTER, nullptr, &size) != 0 || size == 0;
    size = sizeof locked;
    getsockopt(socket.get(), SOL_SOCKET, SO_LOCK_FILTER, &locked, &size);
    ++sockets.seen;
    sockets.open += has_none || locked == 0;
  }
}

// Looks at a receiver's sockets without a pause until it is destroyed.
class Watch {
 public:
  explicit Watch(const aravis::ReceiverProcess& receiver)
      : thread_([this, pid = receiver.pid()] {
          while (!done_) look(pid, sockets_);
        }) {}
  ~Watch() { end(); }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  Sockets end() {
    done_ = true;
    if (thread_.joinable()) thread_.join();
    return sockets_;
  }

 private:
  std::atomic<bool> done_ = false;
  Sockets sockets_;
  std::thread thread_;
};

class ReceiversSockets : public HostileNetwork {
 protected:
  static void expect_filtered(const Sockets& sockets) {
    if (sockets.seen == 0 && sockets.refused > 0)
      GTEST_SKIP() << "this process may not look at the sockets of the processes that it starts";
    EXPECT_GT(sockets.seen, 0);
    EXPECT_EQ(sockets.open, 0) << "of " << sockets.seen;
  }
};

// Nothing answers at this address, so that the socket of the control channel waits for seconds.
TEST_F(ReceiversSockets, HaveTheirFiltersWhileACameraIsOpened) {
  CameraSettings settings;
  settings.device = another;
  aravis::ReceiverProcess receiver(aravis::Reach::network);
  Watch watch(receiver);
  EXPECT_THROW(
      receiver.ask(aravis::Kind::open, aravis::Writer()(aravis::Order{settings}), seconds(8)),
      Error);
  expect_filtered(watch.end());
}

TEST_F(ReceiversSockets, HaveTheirFiltersWhileCamerasAreLookedFor) {
  aravis::ReceiverProcess receiver(aravis::Reach::network);
  Watch watch(receiver);
  receiver.ask(aravis::Kind::list, {}, seconds(5));
  expect_filtered(watch.end());
}

TEST_F(ReceiversSockets, HaveTheirFiltersWhileStreamsBegin) {
  CameraSettings settings;
  settings.device = address;
  settings.packet_size = 1500;
  aravis::ReceiverProcess receiver(aravis::Reach::network);
  Watch watch(receiver);
  receiver.ask(aravis::Kind::open, aravis::Writer()(aravis::Order{settings}), seconds(5));
  const aravis::SharedBuffers buffers(aravis::Ring{4, std::size_t{width} * height});
  for (int i = 0; i < 20; ++i) {
    receiver.ask(aravis::Kind::start, aravis::Writer()(buffers.ring()), seconds(2),
                 buffers.descriptor());
    receiver.ask(aravis::Kind::stop, {}, seconds(2));
  }
  expect_filtered(watch.end());
}

// Sends to each port as soon as there is one, until it is destroyed: what is no packet of a stream,
// and, from another host than the camera, also what would be one (number 1).
class Flood {
 public:
  explicit Flood(const char* from) : thread_([this, from] { run(from); }) {}
  ~Flood() {
    done_ = true;
    thread_.join();
  }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;

 private:
  void run(const char* from) const {
    const Sender sender(from);
    std::vector<Bytes> packets;
    std::vector<std::uint32_t> numbers{0, 0x7fffffff, 0xffffffff};
    if (from != std::string(address)) numbers.push_back(1);
    for (const std::uint32_t number : numbers)
      for (const std::uint8_t type : {1, 2, 3}) {
        packets.push_back(extended(type, number, 9000, 0));  // 20 bytes
        packets.push_back(packet(type, number & 0xffffff, 9000, 12));
      }
    while (!done_) {
      const std::vector<std::uint16_t> ports = udp_ports();
      for (const Bytes& bytes : packets) sender.send(bytes, ports);
    }
  }

  std::atomic<bool> done_ = false;
  std::thread thread_;
};

class HostileReopening : public HostileNetwork, public testing::WithParamInterface<const char*> {};

// The flood hits any time between a socket's birth and its filter, if there is any. It is chance
// what it would hit; ReceiversSockets shows that there is none.
TEST_P(HostileReopening, EndsNoReceiverInAFloodThatNeverPauses) {
  const Flood flood(GetParam());
  for (int i = 0; i < 40; ++i) {
    SCOPED_TRACE(i);
    EXPECT_EQ(error_of(open_streaming), "");
  }
}

INSTANTIATE_TEST_SUITE_P(From, HostileReopening, testing::Values(another, address),
                         [](const auto& instance) {
                           return std::string(instance.index == 0 ? "AnotherHost"
                                                                  : "TheCamerasName");
                         });

}  // namespace previz::test::aravis_sockets_test
