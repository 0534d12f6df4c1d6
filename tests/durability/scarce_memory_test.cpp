// A recorder on a computer whose memory runs out at any allocation: the take goes on or ends with
// its reason, every frame is on the disk or counted, and the next take is whole. Some libraries end
// the process; what they leave is then brought in order by the next process, as after any crash.
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "daemon/core/output/salvage.hpp"
#include "tests/durability/scarce_memory.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::scarce_memory_test {

using test::ScarceMemory;
using test::TemporaryDirectory;
using test::wait_until;

constexpr std::uint64_t frames = 4;

// The recording process says this to the one that watches it.
struct Known {
  std::atomic<std::uint64_t> allocations = 0;  // while memory was scarce
  std::atomic<std::uint64_t> frames = 0;       // of the first take, on the disk
};

// Memory that a child shares.
class SharedKnown {
 public:
  SharedKnown()
      : at_(::mmap(nullptr, sizeof(Known), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1,
                   0)),
        known_(new (at_) Known) {}
  ~SharedKnown() { ::munmap(at_, sizeof(Known)); }
  SharedKnown(const SharedKnown&) = delete;
  SharedKnown& operator=(const SharedKnown&) = delete;
  Known* operator->() const { return known_; }

 private:
  void* const at_;
  Known* const known_;
};

// Offers a few frames and their tracks by `attempt`, which does something and returns whether it
// was done. Returns how many frames and tracks it was not done with.
struct Refused {
  std::uint64_t frames = 0, tracks = 0;
};
template <typename Attempt>
Refused offer(Recorder& recorder, std::uint64_t first, const Attempt& attempt) {
  Refused refused;
  for (std::uint64_t i = first; i < first + frames; ++i) {
    const FramePtr frame = picture(i);
    const session::TrackRecord track = track_of(i);
    if (!attempt([&] { recorder.offer(frame); })) ++refused.frames;
    if (!attempt([&] { recorder.offer(track); })) ++refused.tracks;
  }
  return refused;
}

void await_end_of_take(const Recorder& recorder) {
  EXPECT_TRUE(wait_until("the take is over", [&] {
    const RecorderStatus status = recorder.status();
    return !status.recording && !status.writing;
  }));
}

// Records a take while memory is scarce, and one when it is not.
void record_two_takes(const std::filesystem::path& takes, std::size_t from, std::size_t count,
                      const SharedKnown& known) {
  RecorderOptions options = recorder_options({takes});
  options.free_bytes = [](const auto&) { return plenty; };
  std::atomic<std::uint64_t> left_out = 0;
  options.left_out = [&](const std::string&, std::uint64_t pictures) { left_out += pictures; };
  Recorder recorder(std::move(options));
  Refused refused;
  {
    ScarceMemory memory(from, count);
    // As the rig's threads do: what is thrown is counted and reported there.
    const auto attempt = [&](const auto& work) {
      try {
        memory.lacking(work);
      } catch (const std::exception&) {
        return false;
      }
      known->allocations = memory.allocations();
      known->frames = recorder.status().frames;
      return true;
    };
    while (!attempt([&] { recorder.start(); })) continue;  // the button is pressed again
    refused = offer(recorder, 0, attempt);
    while (!attempt([&] { recorder.stop(); })) continue;
    await_end_of_take(recorder);
    known->allocations = memory.allocations();
  }
  const RecorderStatus first = recorder.status();
  EXPECT_EQ(first.failures > 0, !first.fault.empty());
  const std::uint64_t left_out_of_first = left_out;
  recorder.start();
  offer(recorder, frames, [](const auto& work) {
    work();
    return true;
  });
  recorder.stop();
  await_end_of_take(recorder);
  const RecorderStatus second = recorder.status();
  recorder.finish();
  EXPECT_EQ(second.failures, first.failures) << second.fault;
  EXPECT_EQ(left_out, left_out_of_first);
  // A frame that came after the first take had failed stands in the ring.
  EXPECT_LE(frames, frame_count(second.directory));
  EXPECT_GE(frames + (first.failures > 0 ? 1 : 0), frame_count(second.directory));
  EXPECT_TRUE(session::open_session(second.directory).missing.empty());
  EXPECT_EQ(second.frames, frame_count(second.directory));
  if (first.failures > 0) return;
  EXPECT_EQ(frame_count(first.directory) + left_out + refused.frames, frames);
  if (refused.frames + refused.tracks + left_out + first.lost.records == 0) {
    EXPECT_TRUE(session::open_session(first.directory).missing.empty());
  }
}

// Returns the signal that ended the recording; 0: it ended by itself.
int record_in_a_child(const std::filesystem::path& takes, std::size_t from, std::size_t count,
                      const SharedKnown& known) {
  const pid_t child = ::fork();
  if (child == 0) {
    try {
      record_two_takes(takes, from, count, known);
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
    std::fflush(stdout);
    ::_exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status) || WEXITSTATUS(status) == 0);
  return WIFSIGNALED(status) ? WTERMSIG(status) : 0;
}

// What a process that died has recorded is brought in order by the next one.
void expect_in_order(const std::filesystem::path& takes, std::uint64_t known_frames) {
  std::vector<std::string> salvaged;
  Salvage({takes}, [](const std::string& note) { ADD_FAILURE() << note; }).look(salvaged);
  const std::filesystem::path take = takes / "12A_take001";
  if (known_frames == 0 && !std::filesystem::exists(take / "session.toml")) return;
  EXPECT_GE(frame_count(take), known_frames);
}

// So many allocations in a row fail.
class ScarceMemoryOfARecorder : public ::testing::TestWithParam<std::size_t> {
 protected:
  void fail_every(std::size_t nth) {
    const SharedKnown known;
    std::size_t allocations = 1, rounds = 0, deaths = 0;
    for (std::size_t from = 0; from < allocations && !HasFailure(); from += nth, ++rounds) {
      SCOPED_TRACE("from allocation " + std::to_string(from));
      const TemporaryDirectory directory;
      const std::filesystem::path takes = directory / "takes";
      known->frames = 0;
      const int signal = record_in_a_child(takes, from, GetParam(), known);
      allocations = std::max<std::size_t>(allocations, known->allocations);
      if (signal == 0) continue;
      ++deaths;
      EXPECT_TRUE(signal == SIGABRT || signal == SIGSEGV) << signal;
      expect_in_order(takes, known->frames);
    }
    std::printf("  %zu allocations, %zu tried, %zu times a library ended the process\n",
                allocations, rounds, deaths);
    // The libraries were seen not to bear 4 to 9 of 113 single allocations; many more would be our
    // own code that ends. Among several in a row there is more often one of theirs.
    if (GetParam() == 1) {
      EXPECT_LT(5 * deaths, rounds);
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Fail, ScarceMemoryOfARecorder, ::testing::Values(1, 3));

TEST_P(ScarceMemoryOfARecorder, CostsAtMostItsTake) {
  fail_every(11);
}

TEST_P(ScarceMemoryOfARecorder, CostsAtMostItsTakeWhicheverAllocationFails) {
  fail_every(1);
}

}  // namespace previz::output::scarce_memory_test
