// Hosts of the network that mean harm, and cameras that do: packets that nobody asked for, from
// others and in the camera's name, answers that promise a late answer, descriptions that name a
// file of this machine; and a receiving process that is killed or stands still. The process that
// has the take goes on, with frames or without. None of what is sent here would harm Aravis: what
// must be shown is that it is refused.
#include <arpa/inet.h>
#include <arv.h>
#include <fcntl.h>
#include <linux/netlink.h>
#include <linux/seccomp.h>
#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>

#include <csignal>
#include <random>

#include "drivers/aravis/child_process.hpp"
#include "drivers/aravis/protocol.hpp"
#include "drivers/aravis/receiver/sandbox.hpp"
#include "drivers/aravis/receiver_process.hpp"
#include "drivers/box/bpf.hpp"
#include "drivers/lifeline.hpp"
#include "tests/devices/hostile_network.hpp"
#include "tests/support/child_process.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::test::aravis_hostile_test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
const std::string most_memory = "unlimited";  // for what the sanitizers reserve
#else
const std::string most_memory = "3221225472 ";
#endif

TEST_F(HostileNetwork, FramesGoOnAmongPacketsOfAnotherHost) {
  expect_frames_among(another);
}

TEST_F(HostileNetwork, FramesGoOnAmongPacketsOutOfPlaceInTheCamerasName) {
  expect_frames_among(address);
}

// A packet that is well formed and in the camera's name makes the receiver lose frames at most.
TEST_F(HostileNetwork, AForgedPromiseOfAnAnswerHoldsUpNoCall) {
  const auto camera = open_streaming();
  const std::vector<std::uint16_t> ports = udp_ports();
  for (const char* from : {another, address}) Sender(from).send(pending(too_much_ms), ports);
  EXPECT_TRUE(camera->set_exposure(0.004, 1));
  EXPECT_TRUE(takes_a_frame(*camera));
  camera_.reset();  // the camera is unplugged
  for (const char* from : {another, address}) Sender(from).send(pending(too_much_ms), ports);
  // Two seconds are what a call may take; what is above is for a machine that is busy.
  const auto in_time = [](const auto& call) {
    const auto begin = Clock::now();
    call();
    return Clock::now() - begin < milliseconds(2700);
  };
  EXPECT_TRUE(in_time([&] { EXPECT_FALSE(camera->set_exposure(0.016, 1)); }));
  EXPECT_TRUE(in_time([&] { camera->next(milliseconds(100)); }));
  EXPECT_TRUE(in_time([&] { camera->stop(); }));
}

TEST_F(HostileNetwork, ADescriptionThatIsAFileOfThisMachineIsRefused) {
  const fs::path described = directory_ / "camera.xml";
  std::size_t size = 0;
  const char* xml = arv_fake_camera_get_genicam_xml(fake_, &size);
  std::ofstream(described).write(xml, static_cast<std::streamsize>(size));
  const std::string url = "File://" + described.string();
  Bytes bytes(512);  // a register of zeros, but for the text
  std::ranges::copy(url, bytes.begin());
  ASSERT_TRUE(arv_fake_camera_write_memory(fake_, url_register, static_cast<guint32>(bytes.size()),
                                           bytes.data()));
  const auto begin = Clock::now();
  EXPECT_THAT(error_of(open), StartsWith("127.0.0.1: "));
  EXPECT_LT(Clock::now() - begin, seconds(5));
}

TEST_F(HostileNetwork, CamerasAreFoundByProcessesOfTheirOwn) {
  std::string found;
  for (const FoundCamera& camera : camera_driver("aravis").find())
    found += camera.device + ", " + camera.description + "\n";
  EXPECT_THAT(found, HasSubstr("previz-hostile, Aravis Fake, GigEVision at 127.0.0.1"));
}

// The camera that stands behind a lifeline is back within two seconds, its receiver being another.
class LostReceiver : public HostileNetwork, public testing::WithParamInterface<int> {};

TEST_P(LostReceiver, IsReplacedAndFramesGoOn) {
  Lifeline camera("observer", open);
  camera.start();
  ASSERT_TRUE(takes_a_frame(camera));
  for (int i = 0; i < 3; ++i) {
    for (int frames = 0; frames < 5; ++frames) ASSERT_TRUE(takes_a_frame(camera));
    const std::vector<pid_t> before = receivers();
    ASSERT_EQ(before.size(), 1u);
    kill(before.front(), GetParam());
    const auto begin = Clock::now();
    std::string said;
    bool is_back = false;
    while (!is_back && Clock::now() - begin < seconds(10)) {
      const CameraEvent event = camera.next(milliseconds(50));
      if (const auto* trouble = std::get_if<DeviceTrouble>(&event)) said += trouble->what;
      is_back = !said.empty() && std::holds_alternative<FramePtr>(event);
    }
    EXPECT_LT(Clock::now() - begin, seconds(2));
    EXPECT_THAT(said, HasSubstr("its receiving process"));
    EXPECT_NE(receivers(), before);
  }
  const DeviceCounters counted = camera.counters();
  EXPECT_EQ(counted.at("lost"), 3u);
  EXPECT_EQ(counted.at("returned"), 3u);
  EXPECT_TRUE(counted.contains("frames lost with their receiver"));
}

INSTANTIATE_TEST_SUITE_P(Signals, LostReceiver, testing::Values(SIGKILL, SIGSTOP, SIGSEGV),
                         [](const auto& instance) {
                           return std::string(sigabbrev_np(instance.param));
                         });

// What the service's stop sends to all of its processes ends no camera before the take is closed.
TEST_F(HostileNetwork, AReceiverOutlivesTheSignalsOfAStop) {
  const auto camera = open_streaming();
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) kill(receivers().at(0), signal);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(takes_a_frame(*camera));
}

TEST_F(HostileNetwork, AReceiverHasNothingElseInReach) {
  const int secret = ::open("/etc/passwd", O_RDONLY);  // not closed in programs that are started
  const auto camera = open_streaming();
  const fs::path process = fs::path("/proc") / std::to_string(receivers().at(0));
  for (const fs::directory_entry& entry : fs::directory_iterator(process / "fd")) {
    const std::string target = fs::read_symlink(entry.path());
    EXPECT_THAT(target, testing::AnyOf(
                            StartsWith("socket:"), StartsWith("anon_inode:[eventfd]"),
                            StartsWith("/memfd:previzd frames"), "/dev/null",
                            // a sanitizer's report
                            testing::ResultOf(
                                [&](const std::string&) { return entry.path().filename() == "2"; },
                                testing::IsTrue())));
  }
  EXPECT_THAT(session::content_of(process / "status"),
              AllOf(HasSubstr("NoNewPrivs:\t1"), HasSubstr("Seccomp:\t2")));
  EXPECT_THAT(session::content_of(process / "limits"),
              AllOf(testing::ContainsRegex("Max core file size +0 "),
                    testing::ContainsRegex("Max open files +256 "),
                    testing::ContainsRegex("Max address space +" + most_memory)));
  EXPECT_EQ(session::content_of(process / "environ"), "");
  close(secret);
}

TEST(Receiver, EndsWithTheProcessThatStartedIt) {
  ChildProcess owner([](int tells) {
    const aravis::ReceiverProcess receiver(aravis::Reach::network);
    tell(tells, receiver.pid());
    for (;;) pause();
  });
  pid_t receiver = 0;
  ASSERT_TRUE(owner.is_told(receiver));
  EXPECT_TRUE(wait_until("the receiver runs", [&] { return is_running(receiver); }));
  owner.kill();
  EXPECT_TRUE(wait_until("the receiver ends", [&] { return !is_running(receiver); }));
}

// A message of any bytes is read as one of its kind or as none; ASan sees what reads beyond it.
TEST(Receiver, MessagesOfAnyBytesAreReadWithinThem) {
  aravis::FrameNote note;
  note.exposure_s = 0.5;
  const aravis::Pulse pulse{{{"stream failures", 1}, {"stream underruns", 2}}};
  const aravis::Listing listing{{{"a", "b", "c", "d", "e", "f"}}};
  std::mt19937 random(7);
  for (const Bytes& whole :
       {aravis::Writer()(note).bytes(), aravis::Writer()(pulse).bytes(),
        aravis::Writer()(listing).bytes(), aravis::Writer()(aravis::Terms()).bytes()}) {
    for (int i = 0; i < 3000; ++i) {
      aravis::Message message;
      message.bytes = whole;
      message.bytes.resize(random() % (whole.size() + 1));
      if (!message.bytes.empty() && i % 2 == 0)
        message.bytes[random() % message.bytes.size()] = static_cast<std::uint8_t>(random());
      aravis::body_of<aravis::FrameNote>(message);
      aravis::body_of<aravis::Pulse>(message);
      aravis::body_of<aravis::Listing>(message);
      aravis::body_of<aravis::Terms>(message);
      aravis::body_of<std::string>(message);
    }
  }
  aravis::Message message;
  message.bytes = aravis::Writer()(note).bytes();
  ASSERT_TRUE(aravis::body_of<aravis::FrameNote>(message));
  EXPECT_EQ(aravis::body_of<aravis::FrameNote>(message)->exposure_s, 0.5);
  message.bytes.pop_back();
  EXPECT_FALSE(aravis::body_of<aravis::FrameNote>(message));
}

// Whatever is on this machine's USB, its sandbox leaves libusb what it needs to look.
TEST(Receiver, LooksForCamerasOnTheUsb) {
  aravis::ReceiverProcess receiver(aravis::Reach::usb);
  const aravis::Message answer = receiver.ask(aravis::Kind::list, {}, seconds(5));
  EXPECT_TRUE(aravis::body_of<aravis::Listing>(answer));
  EXPECT_FALSE(receiver.gone());
}

// A receiver that was taken over may say what it likes, but nobody waits for it.
TEST(Receiver, ThatOnlyTalksIsEndedAtTheDeadline) {
  aravis::ReceiverProcess receiver(aravis::Reach::network, PREVIZ_FLOODING_RECEIVER);
  const auto descriptors = [] {
    return std::distance(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator());
  };
  const auto before = descriptors();
  const auto begin = Clock::now();
  EXPECT_THAT(error_of([&] { receiver.ask(aravis::Kind::list, {}, milliseconds(300)); }),
              HasSubstr("for 300 ms"));
  EXPECT_LT(Clock::now() - begin, seconds(3));
  EXPECT_TRUE(receiver.gone());
  EXPECT_LE(descriptors(), before);  // what it passed along is closed
}

TEST(Receiver, OfAnotherVersionIsRefused) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  const OwnedDescriptor socket(ends[0]);
  aravis::ChildProcess process(PREVIZ_RECEIVER, {"network", "another"}, OwnedDescriptor(ends[1]));
  ASSERT_TRUE(process.ends_within(seconds(5)));
  aravis::Message message;
  ASSERT_EQ(aravis::receive(socket.get(), message), aravis::Received::message);
  EXPECT_EQ(message.kind, aravis::Kind::refused);
  EXPECT_THAT(aravis::body_of<std::string>(message).value_or(""),
              HasSubstr("another version than the running previzd"));
}

// Runs a call in a process that has entered the sandbox; returns 0, or the error that it had.
template <class Call>
int in_sandbox(bool usb, const Call& call) {
  const pid_t child = fork();
  if (child == 0) {
    if (!error_of([&] { aravis::enter_sandbox(usb); }).empty()) _exit(255);
    _exit(call() < 0 ? errno : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

TEST(Sandbox, HasUdpAndNoOtherSocketOfTheNetwork) {
  const auto opened = [](bool usb, int family, int type, int protocol) {
    return in_sandbox(usb, [=] { return ::socket(family, type, protocol); });
  };
  EXPECT_EQ(opened(false, AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), 0);
  EXPECT_EQ(opened(false, AF_INET, SOCK_STREAM, 0), ESOCKTNOSUPPORT);
  EXPECT_EQ(opened(false, AF_INET, SOCK_RAW | SOCK_NONBLOCK, IPPROTO_UDP), ESOCKTNOSUPPORT);
  EXPECT_EQ(opened(false, AF_UNIX, SOCK_DGRAM, 0), EAFNOSUPPORT);
  EXPECT_EQ(opened(true, AF_INET, SOCK_DGRAM, 0), EAFNOSUPPORT);
  for (const bool usb : {false, true}) {
    EXPECT_EQ(opened(usb, AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE), 0);
    EXPECT_EQ(opened(usb, AF_NETLINK, SOCK_RAW, NETLINK_AUDIT), EPROTONOSUPPORT);
  }
}

TEST(Sandbox, OpensNoFileOfTheMachine) {
  const auto opened = [](bool usb, const char* file) {
    return in_sandbox(usb, [=] { return ::open(file, O_RDONLY | O_CLOEXEC); });
  };
  const bool has_landlock = in_sandbox(true, [] { return 0; }) == 0;
  for (const char* file : {"/etc/passwd", "/proc/self/status", "/dev/null"}) {
    ASSERT_EQ(access(file, R_OK), 0) << file;
    EXPECT_EQ(opened(false, file), EACCES) << file;
    EXPECT_TRUE(!has_landlock || opened(true, file) == EACCES) << file;
  }
}

// The kernel sends a descriptor's owner any signal that was asked for.
TEST(Sandbox, SignalsNobodyByWayOfADescriptor) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0, ends), 0);
  const pid_t victim = getpid();
  for (const bool usb : {false, true}) {
    EXPECT_EQ(in_sandbox(usb, [&] { return fcntl(ends[0], F_SETFL, O_NONBLOCK); }), 0);
    EXPECT_EQ(in_sandbox(usb, [&] { return fcntl(ends[0], F_SETOWN, victim); }), EPERM);
    EXPECT_EQ(in_sandbox(usb, [&] { return fcntl(ends[0], F_SETSIG, SIGKILL); }), EPERM);
    EXPECT_EQ(in_sandbox(usb, [&] { return ioctl(ends[0], FIOSETOWN, &victim); }), EPERM);
  }
  close(ends[0]);
  close(ends[1]);
}

// Runs a call in a process for which the kernel ends this system call with an error, as an older
// kernel or the service's filter does; returns what it says of its trouble, "" for none.
template <class Call>
std::string trouble_without(long system_call, int error, const Call& call) {
  return text_of_child([&] {
    bpf::Program filter =
        bpf::all({bpf::load(BPF_W, offsetof(seccomp_data, nr)),
                  bpf::when(BPF_JEQ, static_cast<std::uint32_t>(system_call),
                            bpf::verdict(SECCOMP_RET_ERRNO | static_cast<std::uint32_t>(error))),
                  bpf::verdict(SECCOMP_RET_ALLOW)});
    const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
    std::string said;
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
        prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program, 0, 0) != 0)
      said = "no filter";
    return said + error_of(call);
  });
}

TEST(Sandbox, WithoutLandlockAUsbReceiverIsRefusedInWordsThatLeadOn) {
  const auto usb = [] { aravis::enter_sandbox(true); };
  const std::string files = "other files than the USB's: ";
  EXPECT_THAT(trouble_without(SYS_landlock_create_ruleset, ENOSYS, usb),
              HasSubstr(files + "this kernel has no Landlock; install Linux 5.13 or later"));
  EXPECT_THAT(trouble_without(SYS_landlock_create_ruleset, EOPNOTSUPP, usb),
              HasSubstr(files + "Landlock is switched off; add landlock to lsm="));
  for (const long call : {SYS_landlock_create_ruleset, SYS_landlock_restrict_self})
    EXPECT_THAT(trouble_without(call, EPERM, usb),
                HasSubstr("not permitted; allow the service the system calls landlock_create"));
  EXPECT_EQ(
      trouble_without(SYS_landlock_create_ruleset, ENOSYS, [] { aravis::enter_sandbox(false); }),
      "");
}

// The receiver may end before or after the request comes, so that it is asked often.
TEST(Receiver, OfAUsbCameraSaysThatThereIsNoLandlock) {
  for (int i = 0; i < 30; ++i) {
    const std::string trouble = trouble_without(SYS_landlock_create_ruleset, ENOSYS, [] {
      aravis::ReceiverProcess receiver(aravis::Reach::usb);
      receiver.ask(aravis::Kind::list, {}, seconds(5));
    });
    EXPECT_THAT(trouble, HasSubstr("this kernel has no Landlock"));
  }
}

TEST(Receiver, ThatMayNotLookForCamerasIsListedWithTheReason) {
  const std::string trouble = trouble_without(SYS_landlock_create_ruleset, ENOSYS, [] {
    for (const FoundCamera& found : camera_driver("aravis").find())
      if (!found.trouble.empty()) throw Error(found.trouble);
  });
  EXPECT_THAT(trouble, StartsWith("cannot look for cameras on the USB: "));
  EXPECT_THAT(trouble, HasSubstr("this kernel has no Landlock"));
}

// A request that is none is refused, and the process goes on.
TEST(Receiver, RefusesWhatItCannotDo) {
  aravis::ReceiverProcess receiver(aravis::Reach::network);
  for (const aravis::Kind kind : {aravis::Kind::start, aravis::Kind::stop, aravis::Kind::expose,
                                  aravis::Kind::trigger, static_cast<aravis::Kind>(999)})
    EXPECT_THROW(receiver.ask(kind, {}, seconds(5)), Error);
  EXPECT_FALSE(receiver.gone()) << receiver.why_gone();
}

TEST(Receiver, TextOfForeignOriginIsPrintable) {
  EXPECT_EQ(aravis::printable("a\x1b[2J\xff\n~"), "a?[2J??~");
}

}  // namespace previz::test::aravis_hostile_test
