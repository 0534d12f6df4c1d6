// What the packet filters of a receiving process let pass, on sockets that nobody but the test
// reads; and that its sockets have them before they can receive: seen on the sockets themselves,
// while nothing answers, and in a flood that never pauses.
#include <linux/filter.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "drivers/aravis/protocol.hpp"
#include "drivers/aravis/receiver/packet_filter.hpp"
#include "drivers/aravis/receiver_process.hpp"
#include "drivers/aravis/shared_buffers.hpp"
#include "tests/devices/hostile_network.hpp"
#include "tests/support/test.hpp"

namespace previz::test::aravis_sockets_test {

using namespace aravis_hostile_test;

constexpr std::uint32_t camera_address = INADDR_LOOPBACK;  // `address`

// Returns whether a socket with this filter receives the packet.
bool passes(const bpf::Program& filter, const char* from, const Bytes& bytes) {
  const OwnedDescriptor socket(::socket(AF_INET, SOCK_DGRAM, 0));
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof own;
  if (!aravis::attach(socket.get(), filter) ||
      bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), size) != 0 ||
      getsockname(socket.get(), reinterpret_cast<sockaddr*>(&own), &size) != 0)
    throw Error("no socket with a filter");
  Sender(from).send(bytes, {ntohs(own.sin_port)});
  pollfd comes{socket.get(), POLLIN, 0};
  return poll(&comes, 1, 200) == 1;
}

// The operands of the instructions of this kind.
std::vector<std::uint32_t> operands(const bpf::Program& filter, unsigned kind) {
  std::vector<std::uint32_t> all;
  for (const sock_filter& instruction : filter)
    if (instruction.code == kind) all.push_back(instruction.k);
  return all;
}

TEST(PacketFilter, OfAStreamPassesTheCamerasPicturesOnly) {
  const bpf::Program filter =
      aravis::stream_filter(camera_address, packet_size, std::int64_t{width} * height);
  for (const bool is_extended : {false, true})
    for (const Bytes& part : whole_picture(is_extended, 1)) {
      EXPECT_TRUE(passes(filter, address, part));
      EXPECT_FALSE(passes(filter, another, part));
    }
  for (const Bytes& part : out_of_place()) EXPECT_FALSE(passes(filter, address, part));
}

// The last numbers that a trailer and a payload packet may have, and the last byte of a leader.
TEST(PacketFilter, OfAStreamEndsWithThePicture) {
  const bpf::Program filter =
      aravis::stream_filter(camera_address, packet_size, std::int64_t{width} * height);
  EXPECT_THAT(operands(filter, BPF_JMP | BPF_JGT | BPF_K), testing::ElementsAre(4, 3, 4, 3));
  const std::vector<std::uint32_t> bytes = operands(filter, BPF_LD | BPF_B | BPF_ABS);
  for (const std::uint32_t header : {8u, 20u})
    EXPECT_THAT(bytes, testing::Contains(8 + header + picture_terms().size() - 1));
}

TEST(PacketFilter, OfAnswersPassesPromisesOfASecond) {
  const bpf::Program filter = aravis::control_filter(camera_address);
  EXPECT_TRUE(passes(filter, address, pending(1'000)));
  EXPECT_FALSE(passes(filter, address, pending(1'001)));
  EXPECT_FALSE(passes(filter, another, pending(1'000)));
}

TEST(PacketFilter, OfASearchPassesWholeAnnouncements) {
  const bpf::Program filter = aravis::discovery_filter();
  Bytes announcement(8 + 248);
  put(announcement, 2, 3, 2);
  EXPECT_TRUE(passes(filter, another, announcement));
  put(announcement, 2, 5, 2);  // the answer to another request
  EXPECT_FALSE(passes(filter, another, announcement));
  EXPECT_EQ(operands(filter, BPF_LD | BPF_B | BPF_ABS).front(), 8 + announcement.size() - 1);
}

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
          while (!done_) {
            look(pid, sockets_);
            has_looked_at_one_ = sockets_.seen + sockets_.refused > 0;
          }
        }) {}
  ~Watch() { end(); }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  Sockets end() {
    done_ = true;
    if (thread_.joinable()) thread_.join();
    return sockets_;
  }
  // Whether there was time to look at a socket, on a computer that has much else to do.
  bool has_looked_at_one() const { return has_looked_at_one_; }

 private:
  std::atomic<bool> done_ = false, has_looked_at_one_ = false;
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
  settings.packet_size = packet_size;
  aravis::ReceiverProcess receiver(aravis::Reach::network);
  Watch watch(receiver);
  receiver.ask(aravis::Kind::open, aravis::Writer()(aravis::Order{settings}), seconds(5));
  const aravis::SharedBuffers buffers(aravis::Ring{4, std::size_t{width} * height});
  for (int i = 0; i < 20 || (i < 2000 && !watch.has_looked_at_one()); ++i) {
    receiver.ask(aravis::Kind::start, aravis::Writer()(buffers.ring()), seconds(2),
                 buffers.descriptor());
    receiver.ask(aravis::Kind::stop, {}, seconds(2));
  }
  expect_filtered(watch.end());
}

// Sends what is not wanted to each port as soon as there is one, until it is destroyed.
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
    const std::vector<Bytes> packets = unwanted(from);
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
