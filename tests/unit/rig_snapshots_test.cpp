// Snapshots number themselves, and leave takes their space; where the live picture goes.
#include "daemon/rig/snapshots.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "daemon/rig/live_files.hpp"
#include "drivers/error.hpp"
#include "tests/support/temporary_directory.hpp"

namespace previz::rig {
namespace rig_snapshots_test {

namespace fs = std::filesystem;

TEST(Snapshots, HaveTheNumberAfterTheLast) {
  const test::TemporaryDirectory directory;
  EXPECT_EQ(claim_snapshot(directory / "new"), directory / "new/snapshot_0001");
  const auto touch = [&](const std::string& name) { const std::ofstream made(directory / name); };
  for (const char* name :
       {"snapshot_0007.exr", "snapshot_0009.png", "snapshot_x.exr", "other_99.exr"})
    touch(name);
  EXPECT_EQ(claim_snapshot(directory.path()), directory / "snapshot_0010");
  EXPECT_EQ(claim_snapshot(directory.path()), directory / "snapshot_0011");
  touch("snapshot_12345.exr");
  EXPECT_EQ(claim_snapshot(directory.path()), directory / "snapshot_12346");
}

// Every file that a claimer finishes stays the only one of its number.
TEST(Snapshots, OfManyAtOnceHaveANumberEach) {
  const test::TemporaryDirectory directory;
  std::mutex mutex;
  std::multiset<fs::path> claimed;
  {
    std::vector<std::jthread> claimers;
    for (int i = 0; i < 4; ++i)
      claimers.emplace_back([&] {
        for (int times = 0; times < 25; ++times) {
          const fs::path stem = claim_snapshot(directory.path());
          fs::rename(stem.string() + ".exr.part", stem.string() + ".exr");
          const std::lock_guard lock(mutex);
          claimed.insert(stem);
        }
      });
  }
  EXPECT_EQ(claimed.size(), 100u);
  EXPECT_EQ((std::set<fs::path>(claimed.begin(), claimed.end()).size()), 100u);
}

TEST(Snapshots, LeaveTheSpaceThatTakesKeepFree) {
  const test::TemporaryDirectory directory;
  const std::uint64_t free = fs::space(directory.path()).available;
  const fs::path takes = directory / "takes";  // which is not there yet
  EXPECT_NO_THROW(check_space(directory.path(), 1'000'000, takes, 0));
  EXPECT_THROW(check_space(directory.path(), 1'000'000, takes, free), Error);
  // The reserve is of the takes' own disk alone.
  if (fs::exists("/dev/shm")) {
    EXPECT_NO_THROW(check_space(directory.path(), 1'000'000, "/dev/shm/takes", free));
  }
  EXPECT_THROW(check_space(directory.path(), 2 * free, "/dev/shm/takes", 0), Error);
}

// The picture of each second goes into memory where systemd has made a folder there.
TEST(LiveFiles, OfAServiceAreInItsRuntimeDirectory) {
  unsetenv("RUNTIME_DIRECTORY");
  EXPECT_EQ(live_directory("/var/lib/out"), "/var/lib/out");
  setenv("RUNTIME_DIRECTORY", "/run/previzd", 1);
  EXPECT_EQ(live_directory("/var/lib/out"), "/run/previzd");
  unsetenv("RUNTIME_DIRECTORY");
}

}  // namespace rig_snapshots_test
}  // namespace previz::rig
