// The whole daemon in the middle of a take: killed, and on a disk that runs full.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <thread>

#include "drivers/error.hpp"
#include "drivers/session/session.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_take.hpp"

namespace previz {
namespace daemon_death_test {

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
  void until(const std::function<bool()>& condition) {
    while (!is_over() && !condition()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
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

// metrics.json is up to a second old: what it counts was captured a second before, or earlier.
TEST(DaemonDeath, KilledItLosesLessThanASecondOfTheTake) {
  Daemon daemon;
  daemon.until([&] { return daemon.captured() > 50; });
  ASSERT_FALSE(daemon.is_over()) << daemon.log();
  const std::uint64_t captured = daemon.captured();
  const std::filesystem::path take = daemon.take();
  EXPECT_TRUE(WIFSIGNALED(daemon.end(SIGKILL)));
  EXPECT_GE(frames_of(take) + 25, captured);
}

// A tmpfs of its own, 2 MB, of which 1 MB is kept free. The disk is looked at once a second, so
// that of 25 frames a second at least 25 are there (with their light, less than 20 kB each).
TEST(DaemonDeath, OnAFullDiskTheTakeEndsReadableAndTheDaemonGoesOn) {
  Daemon daemon([](const std::filesystem::path& takes) {
    const int spaces = CLONE_NEWNS | (geteuid() == 0 ? 0 : CLONE_NEWUSER);
    return unshare(spaces) == 0 && mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
           mount("tmpfs", takes.c_str(), "tmpfs", 0, "size=2m") == 0;
  });
  const auto ended = [&] { return daemon.log().find("take ended") != std::string::npos; };
  daemon.until(ended);
  if (daemon.is_over()) {
    const int status = daemon.end(0);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77)
      GTEST_SKIP() << "this process may not mount a file system of its own";
    FAIL() << daemon.log();
  }
  EXPECT_GT(frames_of(daemon.takes() / "1_take001"), 24u);
  const std::uint64_t captured = daemon.captured();
  daemon.until([&] { return daemon.captured() > captured + 25; });  // it goes on
  ASSERT_FALSE(daemon.is_over()) << daemon.log();
  const int status = daemon.end(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << daemon.log();
}

}  // namespace daemon_death_test
}  // namespace previz
