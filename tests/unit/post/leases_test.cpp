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
    EXPECT_TRUE(one.take(9));
    EXPECT_THAT(leased(folder_, 0, 9, 0), ElementsAre(7));
    two.give_back(7);
    EXPECT_FALSE(two.take(7)) << "it was not its own";
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
  EXPECT_TRUE(leased(folder_, 0, 9, 0).empty());
  EXPECT_TRUE(one.take(7));
  EXPECT_FALSE(Leases(folder_).take(7));
}

TEST_F(LeasesTest, ThatAreTakenOverLeaveNothingBehind) {
  session::write_content(lease(7), "lost 7 1");
  grow_old(7, std::chrono::seconds(600));
  {
    Leases one(folder_);
    EXPECT_TRUE(one.take(7));
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1);
  }
  EXPECT_FALSE(std::filesystem::exists(folder_));
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

// A folder from elsewhere may hold any number of files.
TEST_F(LeasesTest, BeyondAllMachinesAreNotLookedAt) {
  std::filesystem::create_directory(folder_);
  for (int i = 0; i < 12'000; ++i) std::ofstream(lease(static_cast<std::uint64_t>(i))).close();
  EXPECT_LT(leased(folder_, 0, 1'000'000, 0).size(), 10'000u);
}

TEST_F(LeasesTest, AreNotMadeThroughALink) {
  std::filesystem::create_directory(directory_ / "elsewhere");
  std::filesystem::create_directory_symlink(directory_ / "elsewhere", folder_);
  EXPECT_THAT(test::error_of([&] { Leases leases(folder_); }), HasSubstr("is a link"));
}

void join(FolderLocks& locks) {
  const FolderLocks::Transaction transaction(locks);
  locks.join();
}
bool claim(FolderLocks& locks, std::uint64_t frame) {
  const FolderLocks::Transaction transaction(locks);
  return !locks.claim({frame}, 1).empty();
}
std::vector<FolderUser> others(FolderLocks& locks) {
  const FolderLocks::Transaction transaction(locks);
  return locks.others();
}

// One machine has locks and the other, which comes later, has not: each respects what the other
// has, once the first has seen that it came.
TEST(FolderLocksOfTwoMachines, KnowEachOtherWhereOneHasNoLocks) {
  const test::TemporaryDirectory directory;
  FolderLocks with(directory.path());
  join(with);
  EXPECT_TRUE(claim(with, 3));
  FolderLocks without(directory.path(), no_locks);
  EXPECT_EQ(with.missing(), "");
  EXPECT_THAT(without.missing(), AllOf(HasSubstr("the file system has no locks"),
                                       HasSubstr("replaced after three minutes")));
  EXPECT_EQ(others(with).size(), 0u);  // it has a lease from now on
  join(without);
  EXPECT_TRUE(claim(without, 4));
  EXPECT_FALSE(claim(without, 3));
  EXPECT_FALSE(claim(with, 4));
  ASSERT_EQ(others(with).size(), 1u);
  EXPECT_THAT(others(with)[0].frames, ElementsAre(4));
  ASSERT_EQ(others(without).size(), 1u);
  EXPECT_THAT(others(without)[0].frames, ElementsAre(3));
  EXPECT_EQ(users_of(directory.path(), no_locks).size(), 2u);
}

// The frames of a dead process are free at once, whatever their number.
TEST(FolderLocksOfTwoMachines, HaveWhatADeadOneLeft) {
  const test::TemporaryDirectory directory;
  session::write_content(directory / FolderLocks::file_name,
                         R"({"host":"lost","pid":7,"since":"today","frames":[2,3]})");
  const std::filesystem::path lease = directory / "render.leases" / std::to_string(1ull << 62);
  session::write_content(lease, "lost 7 1");
  FolderLocks locks(directory.path(), no_locks);
  join(locks);
  EXPECT_FALSE(claim(locks, 2));
  std::filesystem::last_write_time(
      lease, std::filesystem::last_write_time(lease) - std::chrono::minutes(4));
  EXPECT_TRUE(claim(locks, 2));
  EXPECT_TRUE(claim(locks, 3));
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
