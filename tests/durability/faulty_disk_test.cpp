// The disk of these tests forgets and fails as it says.
#include "tests/durability/faulty_disk.hpp"

#include <fcntl.h>
#include <unistd.h>

#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::test::faulty_disk_test {

using session::content_of;
using session::TemporaryDirectory;

int open_new(const std::filesystem::path& file) {
  return ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
}

void sync_folder(const std::filesystem::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  ASSERT_EQ(::fsync(descriptor), 0);
  ::close(descriptor);
}

TEST(FaultyDisk, KeepsBytesByTheFilesSyncAndNamesByTheFolders) {
  const TemporaryDirectory folder, after;
  FaultyDisk disk(folder.path());
  const int file = open_new(folder / "a");
  ASSERT_EQ(::write(file, "one", 3), 3);
  ASSERT_EQ(::fdatasync(file), 0);
  ASSERT_EQ(::write(file, "two", 3), 3);
  const std::filesystem::path target = after / "disk";
  disk.restore(disk.calls(), AfterPowerCut::what_was_synced, target);
  EXPECT_FALSE(std::filesystem::exists(target / "a")) << "its name was not synced";
  disk.restore(disk.calls(), AfterPowerCut::names, target);
  EXPECT_EQ(content_of(target / "a"), "one");
  disk.restore(disk.calls(), AfterPowerCut::names_and_sizes, target);
  EXPECT_EQ(content_of(target / "a"), std::string("one\0\0\0", 6));
  disk.restore(disk.calls(), AfterPowerCut::everything, target);
  EXPECT_EQ(content_of(target / "a"), "onetwo");
  sync_folder(folder.path());
  disk.restore(disk.calls(), AfterPowerCut::what_was_synced, target);
  EXPECT_EQ(content_of(target / "a"), "one");
  ::close(file);
}

TEST(FaultyDisk, KeepsTheOldFileUntilARenameIsSynced) {
  const TemporaryDirectory folder, after;
  FaultyDisk disk(folder.path());
  for (const char* name : {"old", "new"}) {
    const int file = open_new(folder / name);
    ASSERT_EQ(::write(file, name, 3), 3);
    ASSERT_EQ(::fsync(file), 0);
    ::close(file);
  }
  sync_folder(folder.path());
  ASSERT_EQ(std::rename((folder / "new").c_str(), (folder / "old").c_str()), 0);
  const std::filesystem::path target = after / "disk";
  disk.restore(disk.calls(), AfterPowerCut::what_was_synced, target);
  EXPECT_EQ(content_of(target / "old"), "old");
  EXPECT_EQ(content_of(target / "new"), "new");
  sync_folder(folder.path());
  disk.restore(disk.calls(), AfterPowerCut::what_was_synced, target);
  EXPECT_EQ(content_of(target / "old"), "new");
  EXPECT_FALSE(std::filesystem::exists(target / "new"));
}

TEST(FaultyDisk, SeesWhatTheStandardLibraryWrites) {
  const TemporaryDirectory folder, after;
  FaultyDisk disk(folder.path());
  std::filesystem::create_directories(folder / "in" / "it");
  std::ofstream(folder / "in" / "it" / "file") << "text";
  std::filesystem::copy_file(folder / "in" / "it" / "file", folder / "copy");
  disk.restore(disk.calls(), AfterPowerCut::everything, after / "disk");
  EXPECT_EQ(content_of(after / "disk" / "in" / "it" / "file"), "text");
  EXPECT_EQ(content_of(after / "disk" / "copy"), "text");
}

// After a failed fsync the pages count as written: a later one succeeds and keeps nothing of them.
TEST(FaultyDisk, FailsTheCallThatItIsAskedTo) {
  const TemporaryDirectory folder, after;
  FaultyDisk disk(folder.path());
  const int file = open_new(folder / "a");
  disk.fail(1, DiskFault::no_space);
  EXPECT_EQ(::write(file, "1234", 4), -1);
  EXPECT_EQ(errno, ENOSPC);
  disk.fail(2, DiskFault::short_write);
  EXPECT_EQ(::write(file, "1234", 4), 2);
  disk.fail(3, DiskFault::io_error);
  EXPECT_EQ(::fdatasync(file), -1);
  EXPECT_EQ(errno, EIO);
  EXPECT_EQ(::fdatasync(file), 0);
  sync_folder(folder.path());
  disk.restore(disk.calls(), AfterPowerCut::what_was_synced, after / "disk");
  EXPECT_EQ(content_of(after / "disk" / "a"), std::string("\0\0", 2));
  ::close(file);
}

}  // namespace previz::test::faulty_disk_test
