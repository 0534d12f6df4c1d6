// The whole daemon in the middle of a take: killed, and on a disk that runs full.
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "tests/support/full_disk.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::daemon_death_test {

using session::content_of;

// `previzd run` on a looped take whose button begins a recording with the first frames.
class Daemon {
 public:
  // `prepare` in the new process; false: it cannot be done here.
  explicit Daemon(const std::function<bool(const std::filesystem::path&)>& prepare = {}) {
    test::write_small_take(directory_.path(), true,
                           "[recording]\nslate = \"1\"\nreserve_mb = 1\n"
                           "[[button]]\nname = \"red\"\naction = \"record\"\n");
    const std::int64_t start = test::small_take_frame(0).timestamp_ns;
    std::ofstream events(directory_ / "session/events.jsonl");
    for (const auto& [ms, pushed] : {std::pair(1, "true"), {2, "false"}})
      events << "{\"timestamp_ns\":" << start + ms * 1'000'000
             << ",\"button\":\"red\",\"pressed\":" << pushed << "}\n";
    events.close();
    std::filesystem::create_directory(directory_ / "takes");

    const std::string set = directory_ / "set.toml", out = directory_ / "live";
    child_ = fork();
    if (child_ != 0) return;
    const int log = open((directory_ / "log").c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
    dup2(log, STDOUT_FILENO);
    dup2(log, STDERR_FILENO);
    if (prepare && !prepare(directory_ / "takes")) _exit(77);
    execl(PREVIZ_BINARY_DIR "/daemon/previzd", "previzd", "run", set.c_str(), "--loop", "--out",
          out.c_str(), nullptr);
    _exit(127);
  }
  ~Daemon() {
    if (child_ > 0) end(SIGKILL);
  }
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  // What wait(2) says of it.
  int end(int signal) {
    if (signal != 0) kill(child_, signal);
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = -1;
    return status;
  }
  bool is_over() {
    siginfo_t info{};
    return waitid(P_PID, static_cast<id_t>(child_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid != 0;
  }
  std::string log() const { return content_of(directory_ / "log"); }
  // Frames of the film camera, as metrics.json says about once a second.
  std::uint64_t captured() const {
    const auto json = nlohmann::json::parse(content_of(directory_ / "live/metrics.json"), nullptr,
                                            /*allow_exceptions=*/false);
    return json.is_discarded() ? 0 : json["stages"]["observer"].value("frames", std::uint64_t{0});
  }
  // Succeeds where the condition holds while the daemon still runs.
  testing::AssertionResult until(const std::string& what, const std::function<bool()>& condition) {
    const testing::AssertionResult result =
        test::wait_until(what, [&] { return is_over() || condition(); });
    if (result && !is_over()) return result;
    return testing::AssertionFailure()
           << (result ? "the daemon ended before " + what : result.message()) << "\n"
           << log();
  }
  // As this process sees it: the daemon may have file systems of its own.
  std::filesystem::path takes() const {
    return "/proc/" + std::to_string(child_) + "/root" + (directory_ / "takes").string();
  }
  std::filesystem::path take() const { return directory_ / "takes/1_take001"; }

 private:
  test::TemporaryDirectory directory_;
  pid_t child_ = -1;
};

// All of the camera's frames from its first on, without a gap.
std::size_t frames_of(const std::filesystem::path& take) {
  session::Session session = session::open_session(take);
  const auto stream = session::open_stream(session, "observer");
  if (!stream) return 0;
  const auto& records = stream->records();
  for (std::size_t i = 0; i < records.size(); ++i) {
    EXPECT_EQ(records[i].sequence, i);
    EXPECT_EQ(stream->read(i)->bytes,
              test::small_take_frame(static_cast<int>(i % test::small_take_frames)).bytes);
  }
  return records.size();
}

// What metrics.json counts was captured and on its way to the recorder when it was written. A
// second of frames later the daemon is killed: by then all of those are the kernel's, which
// outlives the daemon, and none may be missing. This says nothing of a power cut, which also takes
// what the kernel had not yet written.
TEST(DaemonDeath, KilledItKeepsWhatItCapturedASecondBefore) {
  Daemon daemon;
  ASSERT_TRUE(daemon.until("50 frames are captured", [&] { return daemon.captured() > 50; }));
  const std::uint64_t captured = daemon.captured();
  ASSERT_TRUE(daemon.until("a second more is captured",
                           [&] { return daemon.captured() >= captured + 25; }));
  const std::filesystem::path take = daemon.take();
  EXPECT_TRUE(WIFSIGNALED(daemon.end(SIGKILL)));
  EXPECT_GE(frames_of(take), captured);
}

class DaemonOnASmallDisk : public testing::Test {
 protected:
  void SetUp() override {
    if (daemon_.until("it captures", [&] { return daemon_.captured() > 0; })) return;
    const int status = daemon_.is_over() ? daemon_.end(0) : -1;
    if (status != -1 && WIFEXITED(status) && WEXITSTATUS(status) == 77)
      GTEST_SKIP() << "this process may not mount a file system of its own";
    FAIL() << daemon_.log();
  }

  void expect_that_it_goes_on() {
    const std::uint64_t captured = daemon_.captured();
    ASSERT_TRUE(daemon_.until("a second more is captured",
                              [&] { return daemon_.captured() > captured + 25; }));
    const int status = daemon_.end(SIGTERM);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << daemon_.log();
  }
  bool says(const std::string& words) const {
    return daemon_.log().find(words) != std::string::npos;
  }

  // A file system of its own, 2 MB, of which the set keeps 1 MB free.
  Daemon daemon_{
      [](const std::filesystem::path& takes) { return test::mount_small_disk(takes, "2m"); }};
};

// The disk is looked at once a second, so that of 25 frames a second at least 25 are there (with
// their light, less than 20 kB each).
TEST_F(DaemonOnASmallDisk, TheTakeEndsInOrderBeforeTheReserveIsUsed) {
  ASSERT_TRUE(daemon_.until("the take ends", [&] { return says("take ended"); }));
  EXPECT_TRUE(says("the disk is almost full")) << daemon_.log();
  EXPECT_GT(frames_of(daemon_.takes() / "1_take001"), 24u);
  expect_that_it_goes_on();
}

// Somebody else takes all the space there is within a few milliseconds: the recorder's next write
// fails, or its look at the disk comes first.
TEST_F(DaemonOnASmallDisk, FilledBySomebodyElseTheTakeIsReadableAndItGoesOn) {
  const std::filesystem::path take = daemon_.takes() / "1_take001";
  ASSERT_TRUE(daemon_.until("the take has pictures", [&] {
    return std::filesystem::exists(take / "observer.jsonl") &&
           content_of(take / "observer.jsonl").size() > 1000;
  }));
  const std::string lines = content_of(take / "observer.jsonl");
  const auto written = static_cast<std::size_t>(std::ranges::count(lines, '\n'));
  {
    std::ofstream other(daemon_.takes() / "other", std::ios::binary);
    while (other.write("everything", 10).flush()) continue;
  }
  EXPECT_EQ(std::filesystem::space(daemon_.takes()).available, 0u);
  ASSERT_TRUE(daemon_.until("the take ends", [&] { return says("take ended"); }));
  EXPECT_TRUE(says("No space left on device") || says("the disk is almost full")) << daemon_.log();
  EXPECT_GE(frames_of(take), written);
  expect_that_it_goes_on();
}

}  // namespace previz::daemon_death_test
