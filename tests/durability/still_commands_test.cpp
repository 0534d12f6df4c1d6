// What reads and writes takes beside the recording, on disks that stand still at any call: it
// waits, goes on where it was, and shows nobody half of anything meanwhile.
#include <stop_token>

#include "daemon/core/output/salvage.hpp"
#include "daemon/core/output/take_list.hpp"
#include "daemon/tools/post/render_directory.hpp"
#include "daemon/tools/post/take_copy.hpp"
#include "tests/durability/still_disk.hpp"
#include "tests/support/cut_off_take.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_shot.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::post::still_commands_test {

namespace fs = std::filesystem;
using session::TemporaryDirectory;
using test::StillDisk;
using test::wait_until;

constexpr std::uint64_t frames = 3;

// Runs `work` on a thread while the disk of `folder` stands still from this call on, looks at what
// there is meanwhile, and lets it go on. Returns whether the work came to the call.
bool run_past_call(std::size_t call, const fs::path& folder, const std::function<void()>& work,
                   const std::function<void()>& while_still) {
  StillDisk disk(folder);
  disk.stand_still(call);
  std::atomic<bool> is_done = false;
  std::jthread thread([&] {
    EXPECT_NO_THROW(work());
    is_done = true;
  });
  EXPECT_TRUE(wait_until("it waits, or is done", [&] { return is_done || disk.waiting() > 0; }));
  const bool was_still = !is_done;
  if (was_still) while_still();
  disk.go_on();
  return was_still;
}

void nothing_more() {}

TEST(StillDiskOfACopy, AtAnyCallIsWaitedForAndTheCopyIsWhole) {
  bool was_still = true;
  for (std::size_t call = 0; was_still; ++call) {
    SCOPED_TRACE("still at call " + std::to_string(call));
    const TemporaryDirectory directory;
    const fs::path take = directory / "12A_take001", copy = directory / "copies/12A_take001";
    session::write_small_session(take, frames);
    fs::create_directories(copy.parent_path());
    bool is_new = false;
    was_still = run_past_call(
        call, directory.path(), [&] { is_new = copy_take(output::listed_take(take), copy, {}); },
        nothing_more);
    EXPECT_TRUE(is_new);
    EXPECT_TRUE(checksum_faults(copy, {}).empty());
    for (const fs::path& file : session::own_files(take))
      EXPECT_EQ(session::content_of(copy / file), session::content_of(take / file)) << file;
  }
}

// Somebody presses Ctrl-C while the disk stands still: once it answers, nothing is left of the
// copy, or it is whole.
TEST(StillDiskOfACopy, ThatIsStoppedMeanwhileLeavesNoHalfCopy) {
  bool was_still = true;
  for (std::size_t call = 0; was_still; ++call) {
    SCOPED_TRACE("still at call " + std::to_string(call));
    const TemporaryDirectory directory;
    const fs::path take = directory / "12A_take001", copies = directory / "copies";
    session::write_small_session(take, frames);
    fs::create_directories(copies);
    std::stop_source stop;
    const auto work = [&] {
      const std::string fault = test::error_of(
          [&] { copy_take(output::listed_take(take), copies / "12A_take001", stop.get_token()); });
      EXPECT_TRUE(fault.empty() || stop.stop_requested()) << fault;
    };
    was_still = run_past_call(call, directory.path(), work, [&] { stop.request_stop(); });
    for (const fs::directory_entry& entry : fs::directory_iterator(copies)) {
      EXPECT_EQ(entry.path().filename(), "12A_take001");
      EXPECT_TRUE(fs::exists(entry.path() / checksums_name));
      EXPECT_TRUE(checksum_faults(entry.path(), {}).empty());
    }
  }
}

TEST(StillDiskOfATake, ThatWasCutOffIsInOrderAgainWhereverTheDiskStoodStill) {
  bool was_still = true;
  for (std::size_t call = 0; was_still; ++call) {
    SCOPED_TRACE("still at call " + std::to_string(call));
    const TemporaryDirectory directory;
    const fs::path takes = directory / "takes";
    test::write_cut_off_take(takes / "12A_take001", frames);
    std::vector<std::string> salvaged, notes;
    output::Salvage salvage({takes}, [&](const std::string& note) { notes.push_back(note); });
    was_still = run_past_call(
        call, takes, [&] { salvage.look(salvaged); }, nothing_more);
    EXPECT_EQ(salvaged, std::vector<std::string>{"12A_take001 was cut off; it has 3 frames"})
        << testing::PrintToString(notes);
    EXPECT_TRUE(notes.empty()) << notes.front();
    EXPECT_EQ(session::summary_of(takes / "12A_take001").frames, frames);
  }
}

// A render is begun and its frames are checked, and the next frame is written.
TEST(StillDiskOfARender, AtAnyCallIsWaitedForAndTheRenderGoesOn) {
  constexpr const char* settings = R"({"samples": 16})";
  bool was_still = true;
  for (std::size_t call = 0; was_still; ++call) {
    SCOPED_TRACE("still at call " + std::to_string(call));
    const TemporaryDirectory directory;
    set::Set set;
    set.output = {directory / "out", true, true, false};
    {
      RenderDirectory before(set.output, settings, false);
      for (std::uint64_t i = 0; i < frames; ++i) before.write(test::small_shot(i), set);
    }
    const auto go_on = [&] {
      RenderDirectory again(set.output, settings, false);
      for (std::uint64_t i = 0; i < frames; ++i) EXPECT_TRUE(again.finished(i)) << i;
      EXPECT_TRUE(again.rejected().empty());
      EXPECT_FALSE(again.claim({frames}).empty());
      again.write(test::small_shot(frames), set);
    };
    was_still = run_past_call(call, set.output.directory, go_on, nothing_more);
    const RenderDirectory after(set.output, settings, false);
    for (std::uint64_t i = 0; i <= frames; ++i) EXPECT_TRUE(after.finished(i)) << i;
  }
}

}  // namespace previz::post::still_commands_test
