#include "daemon/tools/post/mounts.hpp"

#include "tests/support/session_fixture.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::post::mounts_test {

// Tables of mounts as Linux prints them.
TEST(Mounts, TellWhereLocksHoldOnOneMachineOnly) {
  const test::TemporaryDirectory directory;
  const std::filesystem::path table = directory / "mounts", film = directory / "the film";
  std::filesystem::create_directories(film / "takes");
  std::string place = film.string();
  place.replace(place.find(' '), 1, "\\040");
  const auto locks = [&](const std::string& type, const std::string& options) {
    session::write_content(table,
                           "/dev/sda1 / ext4 rw,relatime 0 0\n"
                           "server:/film " +
                               place + " " + type + " " + options +
                               " 0 0\n"
                               "other:/ /mnt nfs rw,local_lock=all 0 0\n");
    return local_locks_of(film / "takes", table.c_str());
  };
  EXPECT_EQ(locks("nfs", "rw,vers=3,nolock,proto=tcp,local_lock=all"), "nfs with local_lock=all");
  EXPECT_EQ(locks("nfs", "rw,vers=3,local_lock=posix,addr=1"), "nfs with local_lock=posix");
  EXPECT_EQ(locks("nfs", "rw,vers=3,local_lock=flock"), "");
  EXPECT_EQ(locks("nfs4", "rw,vers=4.2,local_lock=none,addr=1"), "");
  EXPECT_EQ(locks("lustre", "rw,flock,lazystatfs"), "");
  EXPECT_EQ(locks("lustre", "rw,localflock"), "lustre with localflock");
  EXPECT_EQ(locks("cifs", "rw,nobrl"), "cifs with nobrl");
  EXPECT_EQ(locks("fuse.sshfs", "rw,nosuid"), "fuse.sshfs");
  EXPECT_EQ(locks("ext4", "rw"), "");
  EXPECT_EQ(local_locks_of(directory.path(), table.c_str()), "");
  EXPECT_EQ(local_locks_of(film, "/nowhere"), "");
}

// The later of two file systems at one place is seen.
TEST(Mounts, LieAboveEarlierOnes) {
  const test::TemporaryDirectory directory;
  const std::string place = directory.path().string();
  session::write_content(directory / "mounts", "a " + place +
                                                   " fuse.sshfs rw 0 0\n"
                                                   "b " +
                                                   place + " ext4 rw 0 0\n");
  EXPECT_EQ(local_locks_of(directory.path(), (directory / "mounts").c_str()), "");
}

}  // namespace previz::post::mounts_test
