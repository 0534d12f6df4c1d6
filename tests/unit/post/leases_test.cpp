// Who has which frame where the file system has no locks that other machines see.
#include "daemon/tools/post/leases.hpp"

#include <thread>

#include "daemon/tools/post/folder_locks.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::post::leases_test {

// fcntl(2) of a file system without locks.
int no_locks(int, int, struct flock*) {
  errno = EOPNOTSUPP;
  return -1;
}

class LeasesTest : public testing::Test {
 protected:
  std::filesystem::path lease(std::uint64_t number) const {
    return folder_ / std::to_string(number);
  }
  void grow_old(std::uint64_t number, std::chrono::seconds by) const {
    const auto time = std::filesystem::last_write_time(lease(number));
    std::filesystem::last_write_time(lease(number), time - by);
  }

  const test::TemporaryDirectory directory_;
  const std::filesystem::path folder_ = directory_ / "render.leases";
};

TEST_F(LeasesTest, GoToOneAndAreGivenBack) {
  {
    Leases one(folder_), two(folder_);
    EXPECT_TRUE(one.take(7));
    EXPECT_TRUE(one.take(7)) << "it has it";
    EXPECT_FALSE(two.take(7));
    EXPECT_TRUE(two.is_at_another(7));
    EXPECT_FALSE(one.is_at_another(7));
    EXPECT_TRUE(one.take(9));
    EXPECT_THAT(two.at_others(0, 9), ElementsAre(7));
    two.give_back(7);
    EXPECT_TRUE(two.is_at_another(7)) << "it was not its own";
    one.give_back(7);
    EXPECT_TRUE(two.take(7));
  }
  EXPECT_FALSE(std::filesystem::exists(folder_));
}

// The process that had it has died: nobody renews the time of its file.
TEST_F(LeasesTest, OfADeadProcessAreTakenOver) {
  session::write_content(lease(7), "lost 7 1");
  Leases one(folder_);
  grow_old(7, std::chrono::seconds(120));
  EXPECT_FALSE(one.take(7));
  grow_old(7, std::chrono::seconds(120));
  EXPECT_FALSE(one.is_at_another(7));
  EXPECT_TRUE(one.take(7));
}

// Two that see at the same moment that it has died.
TEST_F(LeasesTest, OfADeadProcessGoToOneOfTwo) {
  session::write_content(lease(7), "lost 7 1");
  grow_old(7, std::chrono::seconds(600));
  Leases one(folder_), two(folder_);
  bool is_one = false, is_two = false;
  {
    const std::jthread first([&] { is_one = one.take(7); }), second([&] { is_two = two.take(7); });
  }
  EXPECT_NE(is_one, is_two);
}

TEST_F(LeasesTest, ThatWereLeftBehindAreRemovedAtTheEnd) {
  for (const std::uint64_t number : {3, 4}) session::write_content(lease(number), "lost 7 1");
  grow_old(3, std::chrono::hours(1));
  session::write_content(folder_ / "notes.txt", "mine");
  { const Leases one(folder_); }
  EXPECT_FALSE(std::filesystem::exists(lease(3)));
  EXPECT_TRUE(std::filesystem::exists(lease(4)));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "notes.txt"));
}

TEST_F(LeasesTest, AreNotMadeThroughALink) {
  std::filesystem::create_directory(directory_ / "elsewhere");
  std::filesystem::create_directory_symlink(directory_ / "elsewhere", folder_);
  EXPECT_THAT(test::error_of([&] { Leases leases(folder_); }), HasSubstr("is a link"));
}

// One machine has locks and the other has not: each respects what the other has.
TEST(FolderLocksOfTwoMachines, KnowEachOtherWhereOneHasNoLocks) {
  const test::TemporaryDirectory directory;
  FolderLocks with(directory.path()), without(directory.path(), no_locks);
  EXPECT_EQ(with.missing(), "");
  EXPECT_THAT(without.missing(), AllOf(HasSubstr("the file system has no locks"),
                                       HasSubstr("replaced after three minutes")));
  for (FolderLocks* locks : {&without, &with}) {
    const FolderLocks::Transaction transaction(*locks);
    locks->join();
    EXPECT_TRUE(locks->claim(locks == &with ? 3 : 4));
  }
  for (FolderLocks* locks : {&with, &without}) {
    const FolderLocks::Transaction transaction(*locks);
    const std::uint64_t other = locks == &with ? 4 : 3;
    EXPECT_TRUE(locks->is_at_another(other));
    EXPECT_FALSE(locks->claim(other));
    ASSERT_EQ(locks->others().size(), 1u);
    EXPECT_THAT(locks->others()[0].frames, ElementsAre(other));
  }
  EXPECT_EQ(users_of(directory.path(), no_locks).size(), 2u);
}

TEST(FolderLocksOfTwoMachines, ExcludeEachOtherWhereNeitherHasLocks) {
  const test::TemporaryDirectory directory;
  int inside = 0, most = 0;
  std::mutex mutex;
  const auto work = [&] {
    FolderLocks locks(directory.path(), no_locks);
    for (int i = 0; i < 20; ++i) {
      const FolderLocks::Transaction transaction(locks);
      {
        const std::lock_guard guard(mutex);
        most = std::max(most, ++inside);
      }
      std::this_thread::yield();
      const std::lock_guard guard(mutex);
      --inside;
    }
  };
  { const std::jthread one(work), two(work), three(work); }
  EXPECT_EQ(most, 1);
}

// A process that hangs while it changes the folder holds up nobody who looks.
TEST(FolderUsers, AreSeenWithoutWaitingForThem) {
  const test::TemporaryDirectory directory;
  EXPECT_TRUE(users_of(directory / "nowhere").empty());
  FolderLocks other(directory.path());
  const FolderLocks::Transaction transaction(other);
  EXPECT_TRUE(users_of(directory.path()).empty());
  other.join();
  ASSERT_EQ(users_of(directory.path()).size(), 1u);
  EXPECT_EQ(users_of(directory.path())[0].pid, ::getpid());
}

}  // namespace previz::post::leases_test
