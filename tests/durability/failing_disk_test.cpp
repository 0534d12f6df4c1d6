// Takes and sets are read from disks whose calls fail, the reading ones too: whichever it is, the
// fault is said, nothing that was recorded is lost, and all is in order once the disk works again.
#include "daemon/core/output/asset_store.hpp"
#include "daemon/core/output/salvage.hpp"
#include "daemon/core/output/take_list.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/rig/set_keeper.hpp"
#include "daemon/tools/post/render_directory.hpp"
#include "daemon/tools/post/take_copy.hpp"
#include "daemon/tools/post/takes.hpp"
#include "tests/durability/still_disk.hpp"
#include "tests/support/cut_off_take.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/small_shot.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::post::failing_disk_test {

namespace fs = std::filesystem;
using session::TemporaryDirectory;
using test::ReadFault;
using test::StillDisk;

constexpr std::uint64_t frames = 3;

class FailingDisk : public ::testing::TestWithParam<ReadFault> {
 protected:
  // Calls `round` with each call in turn that it makes to a disk, which is to fail.
  void for_each_call(const std::function<void(std::size_t call)>& round) {
    std::size_t call = 0;
    for (failed_ = true; failed_ && !HasFatalFailure(); ++call) round(call);
    std::printf("  %zu calls\n", call - 1);
    EXPECT_GT(call, 10u);
  }

  // Does `work` with the files below this folder while the call fails. Returns what it threw.
  std::optional<std::string> fault_of(const fs::path& folder, std::size_t call,
                                      const std::function<void()>& work) {
    StillDisk disk(folder);
    disk.fail(call, GetParam());
    std::optional<std::string> fault;
    try {
      work();
    } catch (const std::exception& error) {  // of the standard library as well
      fault = error.what();
    }
    failed_ = disk.calls() > call;
    EXPECT_TRUE(failed_ || !fault) << *fault;
    where_ = disk.describe(call);
    return fault;
  }

  bool failed_ = false;  // whether the last work came to the call
  std::string where_;    // and what the call was
};
INSTANTIATE_TEST_SUITE_P(Fails, FailingDisk,
                         ::testing::Values(ReadFault::once, ReadFault::from_then_on));

void expect_frames(const fs::path& take) {
  EXPECT_EQ(output::frames_of(take), output::count_from(0, frames - 1));
}

// A take that was cut off is in order again, or what hindered it is said, and then the next start
// brings it in order.
TEST_P(FailingDisk, KeepsNoTakeFromBeingBroughtInOrder) {
  for_each_call([&](std::size_t call) {
    const TemporaryDirectory directory;
    const fs::path takes = directory / "takes";
    test::write_cut_off_take(takes / "12A_take001", frames);
    std::vector<std::string> salvaged, notes;
    const auto note = [&](const std::string& what) { notes.push_back(what); };
    EXPECT_FALSE(fault_of(takes, call, [&] { output::Salvage({takes}, note).look(salvaged); }));
    SCOPED_TRACE(where_);
    EXPECT_TRUE(!salvaged.empty() || !notes.empty()) << "nothing is said";
    output::Salvage({takes}, note).look(salvaged);
    const session::Summary summary = session::summary_of(takes / "12A_take001");
    EXPECT_FALSE(summary.fault.empty() && !summary.closed) << "it still seems to be recorded";
    EXPECT_EQ(summary.frames, frames);
    expect_frames(takes / "12A_take001");
  });
}

TEST_P(FailingDisk, LeavesAWholeCopyOrNone) {
  for_each_call([&](std::size_t call) {
    const TemporaryDirectory directory;
    const fs::path take = directory / "12A_take001", copy = directory / "copies/12A_take001";
    session::write_small_session(take, frames);
    fs::create_directories(copy.parent_path());
    std::ostringstream out;
    int status = 0;
    const auto fault = fault_of(directory.path(), call, [&] {
      status = copy_takes({{take}, copy.parent_path()}, out, {});
    });
    SCOPED_TRACE(where_);
    EXPECT_TRUE(fault || fs::exists(copy));
    if (fs::exists(copy)) {
      EXPECT_TRUE(checksum_faults(copy, {}).empty());
      expect_frames(copy);
    }
    expect_frames(take);
    EXPECT_EQ(copy_takes({{take}, copy.parent_path()}, out, {}), 0) << out.str();
    for (const fs::path& file : session::own_files(take))
      EXPECT_EQ(session::content_of(copy / file), session::content_of(take / file)) << file;
    for (const auto& entry : fs::directory_iterator(copy.parent_path()))
      EXPECT_EQ(entry.path().filename(), "12A_take001") << "is left over";
  });
}

// A check says that a take is whole only if it is, and with all its frames: a call that fails hides
// no damage, and not even one that only the copy's checksums show.
TEST_P(FailingDisk, PassesForWholeInNoCheck) {
  const TemporaryDirectory directory;
  const fs::path copy = directory / "copies/12A_take001";
  std::ostringstream ignored;
  session::write_small_session(directory / "12A_take001", frames);
  copy_takes({{directory / "12A_take001"}, directory / "copies"}, ignored, {});
  for (const bool is_damaged : {false, true}) {
    if (is_damaged) std::ofstream(copy / "session.toml", std::ios::app) << "# edited\n";
    for_each_call([&](std::size_t call) {
      std::ostringstream out;
      int status = 0;
      const auto fault =
          fault_of(directory.path(), call, [&] { status = check_takes({copy}, out, {}); });
      SCOPED_TRACE(where_);
      const std::string whole = copy.string() + ": whole, 3 frames\n";
      EXPECT_TRUE(fault || status == 1 || (!is_damaged && out.str() == whole)) << out.str();
    });
  }
}

TEST_P(FailingDisk, CostsAResumedRenderNoFrame) {
  constexpr const char* settings = R"({"samples": 16})";
  for_each_call([&](std::size_t call) {
    const TemporaryDirectory directory;
    set::Set set;
    set.output = {directory / "out", true, true, false};
    const auto write = [&](RenderDirectory& render, std::uint64_t frame) {
      if (!render.finished(frame) && !render.claim({frame}).empty())
        render.write(test::small_shot(frame), set);
    };
    {
      RenderDirectory before(set.output, settings, false);
      for (std::uint64_t i = 0; i < frames; ++i) write(before, i);
    }
    fault_of(set.output.directory, call, [&] {
      RenderDirectory again(set.output, settings, false);
      for (std::uint64_t i = 0; i <= frames; ++i) write(again, i);
    });
    SCOPED_TRACE(where_);
    {
      RenderDirectory later(set.output, settings, false);
      for (std::uint64_t i = 0; i <= frames; ++i) write(later, i);
    }
    const RenderDirectory after(set.output, settings, false);
    for (std::uint64_t i = 0; i <= frames; ++i) EXPECT_TRUE(after.finished(i)) << i;
    EXPECT_TRUE(after.rejected().empty());
  });
}

// A take that is reviewed comes with all its pictures, or it is said which ones do not.
TEST_P(FailingDisk, IsSaidInAReview) {
  const TemporaryDirectory directory;
  test::write_small_take(directory.path());
  for_each_call([&](std::size_t call) {
    std::vector<std::string> notes;
    int shots = 0;
    const auto fault = fault_of(directory / "session", call, [&] {
      const pipeline::Take take = pipeline::open_take(directory / "session", {}, false);
      for (const std::string& what : take.session.missing) notes.push_back(what);
      pipeline::TakeShotsOptions options;
      options.note = [&](const std::string& what) { notes.push_back(what); };
      for (const pipeline::Shot& shot : pipeline::TakeShots(take, options)) {
        EXPECT_TRUE(shot.frame);
        ++shots;
      }
    });
    SCOPED_TRACE(where_);
    if (!fault && notes.empty()) {
      EXPECT_EQ(shots, test::small_take_frames);
    }
  });
}

// A set that cannot be read leaves the running one, with the reason, and is read the next time.
TEST_P(FailingDisk, LeavesTheSetThatRuns) {
  for_each_call([&](std::size_t call) {
    const TemporaryDirectory directory;
    const fs::path file = directory / "set.toml";
    test::write_small_take(directory.path());
    std::ostringstream log;
    report::Reports reports(report::lines_to(log));
    rig::SetKeeper sets(
        file, [](set::Set&) {}, reports);
    const auto change = [&] {
      sets.begin_change(0);
      const std::optional<rig::SetKeeper::Ended> ended = sets.finish(std::chrono::seconds(30));
      ASSERT_TRUE(ended);
      EXPECT_EQ(ended->why_not.has_value(), !sets.has_next());
    };
    EXPECT_FALSE(fault_of(directory.path(), call, change));
    SCOPED_TRACE(where_);
    EXPECT_EQ(sets.running().scene.instances.size(), 2u);
    change();
    EXPECT_TRUE(sets.has_next());
  });
}

TEST_P(FailingDisk, DeliversAnAssetWholeOrSaysThatItIsMissing) {
  const TemporaryDirectory elsewhere;
  session::write_content(elsewhere / "a.glb", "a model");
  for_each_call([&](std::size_t call) {
    const TemporaryDirectory directory;
    fs::create_directories(directory / "take");
    std::vector<std::string> notes;
    output::AssetStore::Delivered delivered;
    const auto deliver = [&] {
      output::AssetStore store(directory / "store", {{"a.glb", elsewhere / "a.glb"}},
                               [&](const std::string& what) { notes.push_back(what); });
      const auto order = store.deliver(directory / "take");
      ASSERT_TRUE(test::wait_until("it is done", [&] { return order->result().has_value(); }));
      delivered = *order->result();
    };
    const auto expect_whole = [&] {
      EXPECT_EQ(delivered.assets.size() + delivered.missing.size(), 1u);
      for (const auto& [as_written, place] : delivered.assets)
        EXPECT_EQ(session::content_of(directory / "take" / place), "a model") << place;
    };
    EXPECT_FALSE(fault_of(directory.path(), call, deliver));
    SCOPED_TRACE(where_);
    expect_whole();
    notes.clear();
    deliver();
    EXPECT_TRUE(notes.empty()) << notes.front();
    EXPECT_TRUE(delivered.missing.empty());
    expect_whole();
  });
}

}  // namespace previz::post::failing_disk_test
