// Processes that foreign files are read in: what they have in reach, and what their end costs.
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

#include "daemon/core/program/supervised.hpp"
#include "daemon/core/session/draft.hpp"
#include "drivers/box/confinement.hpp"
#include "drivers/box/in_child.hpp"
#include "drivers/box/reading.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::box_test {

namespace fs = std::filesystem;
using testing::ExitedWithCode;

// Ends the process as a fault of a library does, also where a sanitizer has a handler of its own.
int crash(int signal) {
  std::signal(signal, SIG_DFL);
  return std::raise(signal);
}

class SupervisedDeathTest : public testing::Test {
 protected:
  SupervisedDeathTest() {
    GTEST_FLAG_SET(death_test_style, "fast");
    supervision_.folders = {directory_.path()};
  }

  // Ends as the command would.
  [[noreturn]] void run(const std::function<int()>& work) {
    ::_exit(supervised("previzd", supervision_, work));
  }
  test::TemporaryDirectory directory_;
  Supervision supervision_;
};

TEST_F(SupervisedDeathTest, EndsAsItsWorkDoes) {
  EXPECT_EXIT(run([] { return 0; }), ExitedWithCode(0), "^$");
  EXPECT_EXIT(run([] { return 75; }), ExitedWithCode(75), "^$");
}

TEST_F(SupervisedDeathTest, ACrashIsALineAndLeavesNothingHalfDone) {
  const auto work = [&] {
    const session::DraftFolder draft(directory_ / "take");
    std::ofstream(draft.path() / "observer.mkv") << "half of it";
    const box::Reading reading("clip.mov");
    return crash(SIGSEGV);
  };
  EXPECT_EXIT(
      run(work), ExitedWithCode(1),
      "previzd: the command was stopped: Segmentation fault, while it read clip.mov. If it ends so "
      "again, this file is damaged or meets a fault of a library: export it again, or do without "
      "it\n$");
  EXPECT_TRUE(fs::is_empty(directory_.path()));  // that the child has as well: the style is fast
}

// What was read before is named, and not blamed.
TEST_F(SupervisedDeathTest, ACrashWhileNothingIsReadBlamesNoFile) {
  supervision_.when_stopped = [](pid_t worker, const std::string& words) {
    return worker > 0 && words.ends_with("is clip.mov") ? 75 : 1;
  };
  const auto work = [&] {
    { const box::Reading reading("clip.mov"); }
    return crash(SIGABRT);
  };
  EXPECT_EXIT(run(work), ExitedWithCode(75),
              "the command was stopped: Aborted; what it read last is clip.mov\n$");
}

TEST_F(SupervisedDeathTest, AFileThatALibraryNeverEndsWithEndsTheCommand) {
  supervision_.longest_reading = std::chrono::milliseconds(500);
  const auto hang = [] {
    { const box::Reading before("other.mov"); }
    const box::Reading reading("clip.mov");
    for (std::atomic<int> i = 0;; ++i) continue;
    return 0;
  };
  EXPECT_EXIT(run(hang), ExitedWithCode(1),
              "one file took a library more than ten minutes, while it read clip.mov\\.");
}

TEST_F(SupervisedDeathTest, AFileThatTakesAllMemoryEndsTheCommand) {
  supervision_.most_memory = 1 << 24;
  const auto grow = [] {
    const box::Reading reading("clip.mov");
    std::vector<char> all;
    for (std::size_t size = 1 << 22; size < 1 << 28; size += 1 << 22) {
      all.resize(size, 'x');
      std::this_thread::sleep_for(std::chrono::milliseconds(150));  // it is looked at every second
    }
    return 0;
  };
  EXPECT_EXIT(run(grow), ExitedWithCode(1),
              "one file took more than half of this computer's memory, while it read clip");
}

// A disk that stands still makes a reading last, without any work.
TEST_F(SupervisedDeathTest, AReadingThatWaitsIsLeftAlone) {
  supervision_.longest_reading = std::chrono::milliseconds(500);
  const auto wait = [] {
    const box::Reading reading("clip.mov");
    std::this_thread::sleep_for(std::chrono::milliseconds(2500));  // it is looked at every second
    return 0;
  };
  EXPECT_EXIT(run(wait), ExitedWithCode(0), "^$");
}

// It has what it wrote there in common with the one that waits for it.
TEST_F(SupervisedDeathTest, WhateverTheWorkWritesIntoItsNotesItsEndIsSaid) {
  const auto work = [] {
    box::ReadingNotes* const all = box::reading_notes;
    for (box::ReadingNotes::Note& note : all->notes) note.file.fill('x');
    all->newest = 4'000'000'000;
    return crash(SIGSEGV);
  };
  EXPECT_EXIT(run(work), ExitedWithCode(1), "Segmentation fault; what it read last is xxx");
}

TEST_F(SupervisedDeathTest, OfFilesThatAreReadAtOnceAllAreNamed) {
  const auto work = [] {
    const box::Reading a("good.mov"), b("bad.exr");
    return crash(SIGSEGV);
  };
  EXPECT_EXIT(run(work), ExitedWithCode(1), "while it read one of bad.exr, good.mov\\. If it");
}

// A render may take as long, and as much, as it likes.
TEST_F(SupervisedDeathTest, WorkThatReadsOneFileAfterAnotherIsLeftAlone) {
  supervision_.longest_reading = std::chrono::milliseconds(1500);
  supervision_.most_memory = 1 << 24;
  const auto work = [] {
    const std::vector<char> before(1 << 26, 'x');
    for (int i = 0; i < 22; ++i) {
      const box::Reading reading("clip.mov");
      const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(100);
      while (std::chrono::steady_clock::now() < end) continue;
    }
    return 0;
  };
  EXPECT_EXIT(run(work), ExitedWithCode(0), "^$");
}

TEST_F(SupervisedDeathTest, PassesSignalsOn) {
  const auto wait = [] {
    sigset_t term;
    sigemptyset(&term);
    sigaddset(&term, SIGTERM);
    sigprocmask(SIG_BLOCK, &term, nullptr);
    ::kill(::getppid(), SIGTERM);
    int signal = 0;
    sigwait(&term, &signal);
    return 128 + signal;
  };
  EXPECT_EXIT(run(wait), ExitedWithCode(128 + SIGTERM), "^$");
}

// A thread of this program is enough for the kernel, and a process of its own for the test.
TEST_F(SupervisedDeathTest, ConfinedItWritesWhereItMayAndHasNoNetworkAndNoPrograms) {
  const auto try_all = [&] {
    fs::create_directories(directory_ / "mine");
    fs::create_directories(directory_ / "others");
    std::ofstream(directory_ / "others/secret") << "text";
    try {
      box::leave_network_and_programs();
      box::confine_files({{"/"}, {directory_ / "mine"}, {}});
    } catch (const Error& error) {
      return std::string(error.what()).find("Landlock") != std::string::npos ? 77 : 2;
    }
    std::ofstream(directory_ / "mine/a") << "text";
    fs::create_directory(directory_ / "mine/folder");
    fs::rename(directory_ / "mine/a", directory_ / "mine/folder/b");
    std::ofstream(directory_ / "others/secret") << "changed";
    std::error_code refused;
    fs::remove(directory_ / "others/secret", refused);
    fs::resize_file(directory_ / "others/secret", 0, refused);
    ::close(::open((directory_ / "others/secret").c_str(), O_RDONLY | O_TRUNC));
    const bool is_kept = test::content_of(directory_ / "others/secret") == "text" &&
                         test::content_of(directory_ / "mine/folder/b") == "text";
    const bool has_network =
        ::socket(AF_INET, SOCK_STREAM, 0) >= 0 || ::socket(AF_INET6, SOCK_DGRAM, 0) >= 0;
    ::execl("/bin/true", "true", nullptr);  // returns where it is refused
    return is_kept && !has_network ? 0 : 1;
  };
  const auto is_well = [](int status) {  // 77: this kernel has no Landlock
    return WIFEXITED(status) && (WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == 77);
  };
  EXPECT_EXIT(run(try_all), is_well, "");
}

// A library that reads for a child has nothing else in reach.
TEST(InChild, HasNoFiles) {
  const test::TemporaryDirectory directory;
  std::ofstream(directory / "secret") << "text";
  const std::string read = box::in_child("a.fbx", [&] {
    std::ofstream(directory / "made") << "text";
    return test::content_of(directory / "secret");
  });
  EXPECT_EQ(fs::exists(directory / "made"), !read.empty()) << "where there is no Landlock";
}

}  // namespace previz::box_test
