// Takes on disks that stand still, at any call: nobody but the recorder's own threads waits, and
// what is offered meanwhile is recorded or counted.
#include "tests/durability/still_disk.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::still_recorder_test {

using session::TemporaryDirectory;
using test::StillDisk;
using test::wait_until;

struct Rig {
  const TemporaryDirectory directory;
  const std::filesystem::path first = directory / "first", second = directory / "second";

  RecorderOptions options() const { return recorder_options({first, second}); }
};

// Offers a take. Where anything of this waits for the disk, the test never ends.
constexpr std::uint64_t frames_offered = 4;
void offer_take(Recorder& recorder) {
  recorder.start();
  for (std::uint64_t i = 0; i < frames_offered; ++i) {
    recorder.offer(picture(i));
    recorder.offer(track_of(i));
    recorder.offer_event(0, "something");
  }
  static_cast<void>(recorder.status());
  static_cast<void>(recorder.folders());
  static_cast<void>(recorder.free_bytes());
  recorder.mark_good();
  recorder.stop();
}

TEST(StillDisk, AtAnyCallKeepsNobodyWaitingAndLosesNoFrameUncounted) {
  for (std::size_t call = 0;; ++call) {
    Rig rig;
    StillDisk disk(rig.first);
    disk.stand_still(call);
    bool was_still = true;
    std::filesystem::path take;
    session::Losses lost;
    {
      Recorder recorder(rig.options());
      offer_take(recorder);
      ASSERT_TRUE(wait_until("it waits, or is done", [&] {
        return disk.waiting() > 0 || recorder.status().finished_takes == 1;
      }));
      was_still = disk.waiting() > 0;
      disk.go_on();
      ASSERT_TRUE(wait_for_finished(recorder, 1));
      recorder.finish();
      take = recorder.status().directory;
      lost = recorder.status().lost;
    }
    SCOPED_TRACE("still at call " + std::to_string(call));
    EXPECT_EQ(frame_count(take) + lost.frames, frames_offered);
    EXPECT_EQ(lost.frames, 0u);
    if (!was_still) break;
  }
}

// The second disk is of no concern as long as the first is good, whatever was left on it.
TEST(StillDisk, ThatIsTheSecondKeepsNothingFromTheFirst) {
  Rig rig;
  std::filesystem::create_directories(rig.second / "12A_take001");
  StillDisk disk(rig.second);
  disk.stand_still();
  {
    Recorder recorder(rig.options());
    ASSERT_TRUE(wait_until("it is still", [&] { return disk.waiting() > 0; }));
    offer_take(recorder);
    ASSERT_TRUE(wait_for_finished(recorder, 1));
    EXPECT_EQ(recorder.status().directory.parent_path(), rig.first);
    EXPECT_GT(recorder.folders().at(1).silent_s, 0);
  }  // and ends
  EXPECT_EQ(frame_count(rig.first / "12A_take001"), frames_offered);
}

}  // namespace previz::output::still_recorder_test
