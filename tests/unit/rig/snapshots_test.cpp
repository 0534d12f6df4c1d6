// Snapshots number themselves, and leave takes their space; where the live picture goes.
#include "daemon/core/live/snapshots.hpp"

#include "daemon/rig/live_files.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::snapshots_test {

namespace fs = std::filesystem;

TEST(Snapshots, HaveTheNumberAfterTheLast) {
  const test::TemporaryDirectory directory;
  const auto put = [&](const fs::path& folder) {
    session::Draft exr(folder / "snapshot.exr");
    return live::put_snapshot(exr);
  };
  fs::create_directory(directory / "new");
  EXPECT_EQ(put(directory / "new"), directory / "new/snapshot_0001");
  const auto touch = [&](const std::string& name) { const std::ofstream made(directory / name); };
  for (const char* name :
       {"snapshot_0007.exr", "snapshot_0009.png", "snapshot_x.exr", "other_99.exr"})
    touch(name);
  EXPECT_EQ(put(directory.path()), directory / "snapshot_0010");
  EXPECT_EQ(put(directory.path()), directory / "snapshot_0011");
  touch("snapshot_12345.exr");
  EXPECT_EQ(put(directory.path()), directory / "snapshot_12346");
}

// Every file that is put stays the only one of its number.
TEST(Snapshots, OfManyAtOnceHaveANumberEach) {
  const test::TemporaryDirectory directory;
  std::mutex mutex;
  std::set<std::string> contents;
  {
    std::vector<std::jthread> writers;
    for (int i = 0; i < 4; ++i)
      writers.emplace_back([&, i] {
        for (int times = 0; times < 25; ++times) {
          session::Draft exr(directory / "snapshot.exr");
          exr.file().append(std::to_string(100 * i + times));
          const fs::path stem = live::put_snapshot(exr);
          const std::lock_guard lock(mutex);
          contents.insert(test::content_of(stem.string() + ".exr"));
        }
      });
  }
  EXPECT_EQ(contents.size(), 100u);
  EXPECT_EQ(std::distance(fs::directory_iterator(directory.path()), {}), 100);
}

TEST(Snapshots, LeaveTheSpaceThatTakesKeepFree) {
  const test::TemporaryDirectory directory;
  const std::uint64_t free = fs::space(directory.path()).available;
  const fs::path takes = directory / "takes";  // which is not there yet
  EXPECT_NO_THROW(live::check_space(directory.path(), 1'000'000, takes, 0));
  EXPECT_THROW(live::check_space(directory.path(), 1'000'000, takes, free), Error);
  // The reserve is of the takes' own disk alone.
  EXPECT_NO_THROW(live::check_space(directory.path(), 1'000'000, "/proc/takes", free));
  EXPECT_THROW(live::check_space(directory.path(), 2 * free, "/proc/takes", 0), Error);
}

// The picture of each second goes into memory where systemd has made a folder there.
TEST(LiveFiles, OfAServiceAreInItsRuntimeDirectory) {
  unsetenv("RUNTIME_DIRECTORY");
  EXPECT_EQ(live_directory("/var/lib/out"), "/var/lib/out");
  setenv("RUNTIME_DIRECTORY", "/run/previzd", 1);
  EXPECT_EQ(live_directory("/var/lib/out"), "/run/previzd");
  unsetenv("RUNTIME_DIRECTORY");
}

}  // namespace previz::rig::snapshots_test
