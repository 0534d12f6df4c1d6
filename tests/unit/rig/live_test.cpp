// The daemon from end to end: a replayed take, a crew that presses buttons when it sees what it
// waits for, and afterwards what was shown, said and recorded.
#include "daemon/rig/live.hpp"

#include <sys/resource.h>

#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::live_test {

using pipeline::Shot;
using test::RigLive;

void expect_same(const render::Layers& a, const render::Layers& b) {
  EXPECT_EQ(a.samples, b.samples);
  EXPECT_TRUE(a.composite == b.composite);
  EXPECT_TRUE(a.mixed == b.mixed);
  EXPECT_TRUE(a.real == b.real);
  EXPECT_TRUE(a.variance == b.variance);
  EXPECT_TRUE(a.mask == b.mask);
  EXPECT_TRUE(a.depth == b.depth);
}

TEST_F(RigLive, ThroughEveryModeByButtons) {
  write_set();
  Shown refined, reviewed;
  run_rendering([&] {
    press("move_right");
    until([](const Shown& s) { return s.shot.scene.objects.contains("card"); });
    press("light_up");
    until([](const Shown& s) { return s.shot.scene.lights.contains("key"); });
    press("samples_up");
    until_samples(3);
    press("debug_view");
    until([](const Shown& s) { return s.look.view == render::View::mixed; });
    for (std::size_t i = 1; i < render::all_views.size(); ++i) press("debug_view");
    until([](const Shown& s) { return s.look.view == render::View::composite; });

    const Shown first = begin_take();
    until([&](const Shown& s) {  // long enough for a press to fall into its review
      return s.shot.frame->timestamp_ns > first.shot.frame->timestamp_ns + 2'000'000'000 &&
             s.shot.samples == 3;
    });
    press("refine");  // what is frozen is in the take, which goes on
    refined = until_frozen(9);
    EXPECT_TRUE(refined.look.state.recording);
    press("snapshot");
    until_mode(live::Mode::live);
    until_said("snapshot_0001");
    end_take();
    press("mark_good");
    until_said("marked good");

    std::set<std::int64_t> in_take;
    for (const session::TrackRecord& record : session::open_session(take_folder()).track)
      in_take.insert(record.timestamp_ns);
    const int before = shown_now().count;
    press("review");
    until([&](const Shown& s) {
      return s.count > before + 2 && s.look.state.mode == live::Mode::review &&
             s.shot.samples == 3 && in_take.contains(s.shot.frame->timestamp_ns);
    });
    press("refine");
    reviewed = until_frozen(6);
    press("snapshot");
    until_mode(live::Mode::live);
    until_said("snapshot_0002");
    press("standby");
    until_said("button standby: standby");
    press("standby");
    until_more(0);
  });

  // Every frame of the take is the camera's, in an unbroken row.
  const std::filesystem::path take = take_folder();
  const std::vector<session::FrameRecord> records = test::unbroken(take);
  session::Session session = session::open_session(take);
  EXPECT_TRUE(session.info.take->good);
  const auto stream = session::open_stream(session, "observer");
  for (std::size_t i = 0; i < records.size(); ++i)
    EXPECT_EQ(stream->read(i)->bytes,
              test::small_take_frame(static_cast<int>(records[i].sequence % 8)).bytes);
  EXPECT_EQ(session.track.back().scene.objects.count("card"), 1u);
  EXPECT_TRUE(session.track.back().captured_light);

  // Both refinements were saved as they were shown; that of the take's frame is bit for bit what
  // `previz render` makes of it. (Which captured light a live frame had depends on when its thread
  // was done; ALiveRefinementIsWhatRenderMakesOfItsFrame has light that does not.)
  const auto saved = [&](const char* number) {
    return output::read_exr(directory_ / (std::string("live/snapshot_") + number + ".exr"));
  };
  EXPECT_GE(saved("0001").samples, refined.shot.samples);
  const render::Layers from_take = saved("0002");
  EXPECT_GE(from_take.samples, reviewed.shot.samples);
  expect_same(from_take, rendered(take, reviewed.shot.frame->timestamp_ns, from_take.samples));
  EXPECT_EQ(output::read_png(directory_ / "live/snapshot_0002.png").width, 48);
  EXPECT_GT(metrics_.counts.at("refine rounds"), 0u);
}

// A set is saved, changed or not, and moves its takes to another folder: the last take stays.
TEST_F(RigLive, ASetThatIsReadAgainKeepsTheLastTake) {
  write_set();
  const auto reload = [this](int times) {
    press("reload_set");
    test::must_come(
        "the set runs again", [&] { return count_said("live on ") > times; },
        [&] { return log_.text(); });
    until_more(0);
  };
  run_rendering([&] {
    const Shown first = begin_take();
    until([&](const Shown& s) { return is_long_after(s, first); });
    end_take();
    reload(1);
    press("review");
    until_mode(live::Mode::review);
    press("live");
    until_mode(live::Mode::live);
    replace_in_set("directory = \"takes\"", "directory = \"others\"");
    reload(2);
    press("review");
    until_said("12A_take001 was recorded with another text of the set");
    press("mark_good");
    until_said("12A_take001 is marked good");
  });
  EXPECT_TRUE(session::open_session(take_folder()).info.take->good);
}

// Bit for bit, where the light is the set's and depends on no thread's pace.
TEST_F(RigLive, ALiveRefinementIsWhatRenderMakesOfItsFrame) {
  write_set("[lighting]\nfrom = \"set\"\n");
  Shown refined;
  run_rendering([&] {
    const Shown first = begin_take();
    until([&](const Shown& s) {  // the frame that is frozen then was captured after the press
      return s.shot.frame->timestamp_ns > first.shot.frame->timestamp_ns + 1'000'000'000 &&
             s.shot.samples == 2;
    });
    press("refine");
    refined = until_frozen(6);
    press("snapshot");
    until_said("snapshot_0001");
    end_take();
  });
  const render::Layers live = output::read_exr(directory_ / "live/snapshot_0001.exr");
  EXPECT_GE(live.samples, refined.shot.samples);
  EXPECT_GT(std::ranges::max(live.mask), 0.0f);  // there is something to compare
  expect_same(live, rendered(take_folder(), refined.shot.frame->timestamp_ns, live.samples));
}

// Without a take nobody needs the poses and the light of the frames that come while one is refined.
TEST_F(RigLive, TrackingAndLightEstimationRestInARefinement) {
  write_set();
  run_rendering([&] {
    press("refine");
    until_mode(live::Mode::refine);
    until_counted("frames not tracked in this mode");
    until_counted("light frames not evaluated in this mode");
  });
}

// A take gets the pose and the light of every frame, whatever is shown.
TEST_F(RigLive, TrackingDoesNotRestInATake) {
  write_set();
  run_rendering([&] {
    begin_take();
    press("refine");
    const Shown begun = until_frozen();
    until([&](const Shown& s) { return s.shot.frozen && s.count > begun.count + 8; });
    press("live");
    until_mode(live::Mode::live);
  });
  EXPECT_FALSE(metrics_.counts.contains("frames not tracked in this mode"));
  EXPECT_FALSE(metrics_.counts.contains("light frames not evaluated in this mode"));
}

// The press ends the refinement at once, but what it asks for is known only once it cannot become
// a double press any more; live pictures were shown by then.
TEST_F(RigLive, ASnapshotIsOfTheRefinementThatItsPressEnded) {
  write_set("[[button]]\nname = \"snapshot\"\npress = \"double\"\naction = \"standby\"\n");
  Shown refined;
  run_rendering([&] {
    press("refine");
    refined = until_frozen(6);
    press("snapshot");
    until_mode(live::Mode::live);
    until_said("snapshot_0001");
    press("snapshot");
    until_said("snapshot_0002");
  });
  const auto samples = [&](const char* name) {
    return output::read_exr(directory_ / "live" / name).samples;
  };
  EXPECT_GE(samples("snapshot_0001.exr"), refined.shot.samples);
  EXPECT_LE(samples("snapshot_0002.exr"), 2);  // of the next picture; 0 without a pose
}

TEST_F(RigLive, AButtonThatIsNotThereIsToldOfAndHoldsUpNobody) {
  write_set("[[button]]\nname = \"gpio:absent:3\"\naction = \"record\"\n");
  run([&] {
    until_said("gpio:absent");
    const int before = until_samples(2).count;
    press("samples_up");  // the others are heard
    until([&](const Shown& s) { return s.shot.samples == 3 && s.count > before; });
  });
  EXPECT_FALSE(std::filesystem::exists(take_folder()));
}

// Captured = rendered + dropped by cause, whatever was done in between.
TEST_F(RigLive, EveryCapturedFrameIsRenderedOrCounted) {
  write_set();
  run_rendering([&] {
    press("refine");
    until_frozen(4);
    press("standby");  // only ends the refinement
    until_mode(live::Mode::live);
    press("standby");
    until_said("button standby: standby");
    // A few frames in the dark. Nothing is shown or written of them before the next picture.
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    press("live");
    until_mode(live::Mode::live);
    until_counted("standby");
  });
  EXPECT_GT(metrics_.stages.at("render").dropped.at("standby"), 0u);
  EXPECT_EQ(test::accounted_for(metrics_), metrics_.stages.at("observer").frames);
}

// A disk that does not take picture.png is reported, and no reason to stop.
TEST_F(RigLive, GoesOnWhereItsFilesCannotBeWritten) {
  write_set();
  run_rendering([&] {
    std::filesystem::rename(directory_ / "live", directory_ / "gone");
    std::ofstream(directory_ / "live") << "a file where the directory was";
    until_said((directory_ / "live").string());
    until_more(2);
    std::filesystem::remove(directory_ / "live");
    std::filesystem::create_directory(directory_ / "live");  // and it is written again
    test::must_come("there is a picture.png again",
                    [&] { return std::filesystem::exists(directory_ / "live/picture.png"); });
  });
  EXPECT_EQ(output::read_png(directory_ / "live/picture.png").width, 48);
}

TEST_F(RigLive, ABadSetLeavesTheOldOneRunningAndAGoodOneTakesOver) {
  write_set();
  const std::string good = test::content_of(directory_ / "set.toml");
  run_rendering([&] {
    std::ofstream(directory_ / "set.toml") << "[quality]\nsamples = none\n";
    press("reload_set");
    until_said("the old set stays in use");
    until_said("button reload_set: the old set stays in use: ");  // and so says the bus
    until_more(2);                                                // it goes on
    std::ofstream(directory_ / "set.toml") << good;
    replace_in_set("samples = 2", "samples = 4");
    press("reload_set");
    until_samples(4);
    std::ofstream(directory_ / "z.toml") << good;
    press("next_set");
    until_samples(2);
    press("previous_set");
    until_samples(4);
  });
  EXPECT_THAT(log_.text(), HasSubstr("set.toml:2:"));
}

// A set that can be read and cannot be started is not started again and again.
TEST_F(RigLive, ASetThatCannotStartIsTriedOnce) {
  write_set();
  run_rendering([&] {
    const std::string good =
        replace_in_set("[observer]\n", "[observer]\nfaults = [\"nonsense\"]\n");
    until_said("back to the previous set");  // the rig saw the file by itself
    // What must not happen cannot be waited for: its next looks at the file, one a second.
    std::this_thread::sleep_for(std::chrono::seconds(4));
    EXPECT_EQ(count_said("back to"), 1) << log_.text();
    std::ofstream(directory_ / "set.toml") << good;
    replace_in_set("samples = 2", "samples = 4");
    until_samples(4);
  });
}

// The second folder is needed in the middle of a take at the earliest, and is looked at before.
TEST_F(RigLive, AFolderOfTakesThatCannotBeWrittenIsReportedBeforeATakeNeedsIt) {
  write_set("second_directory = \"second/takes\"\n");
  std::ofstream(directory_ / "second") << "a file where the disk's folder should be";
  const std::string trouble =
      (directory_ / "second/takes").string() + ": is not writable for takes: it is not a folder";
  run([&] {
    until_said(trouble);
    begin_take();
    end_take();  // in the first folder
  });
  EXPECT_EQ(count_said("is not writable for takes"), 1) << log_.text();
}

// The buttons of a replayed take are pressed again, at its own times.
TEST_F(RigLive, ARecordedTakePressesItsButtonsAgain) {
  write_set("preroll_s = 0\n");
  const std::int64_t start = test::small_take_frame(0).timestamp_ns;
  std::ofstream events(directory_ / "session/events.jsonl");
  for (const auto& [ms, pushed] : {std::pair(100, "true"), {120, "false"}})
    events << "{\"timestamp_ns\":" << start + ms * 1'000'000
           << ",\"button\":\"record\",\"pressed\":" << pushed << "}\n";
  events.close();
  run([&] {
    const int first = until([](const Shown& s) { return s.look.state.recording; }).count;
    until([&](const Shown& s) { return s.count > first + 8; });
  });
  session::Session session = session::open_session(take_folder());
  EXPECT_TRUE(session.missing.empty());
  EXPECT_GT(session::open_stream(session, "observer")->records().size(), 0u);
}

// A restart in the middle of a take, as for an upgrade: the new process records on by itself, and
// says so on the display until somebody has taken note.
TEST_F(RigLive, RecordsOnAfterARestartUntilSomebodyEndsIt) {
  write_set();
  int before = 0;  // pictures of the runs before
  const auto until_recorded = [&](bool recording) {
    until([&](const Shown& s) {
      return s.count > before + 3 && s.look.state.recording == recording && s.shot.samples == 2;
    });
  };
  run([&] {
    press("record");
    until_recorded(true);
  });
  before = shown_.count;
  run([&] {
    until_said("12A_take001 was cut off; recording continues in the next take");
    until_recorded(true);
    press("acknowledge");
    until_said("button acknowledge: noted");
    end_take("12A_take002");
  });
  EXPECT_TRUE(session::open_session(take_folder()).missing.empty());
  EXPECT_GT(session::open_session(take_folder("12A_take002")).track.size(), 0u);
  before = shown_.count;
  run([&] { until_recorded(false); });
  EXPECT_FALSE(std::filesystem::exists(take_folder("12A_take003")));
}

// The threads that Mesa's driver for the processor draws in yield to those of the recorder.
TEST_F(RigLive, WhatDrawsOnTheProcessorYieldsToTheRecording) {
  write_set();
  int drawing = 0, yielding = 0;
  run_rendering([&] {
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
      std::string name;
      std::ifstream(task.path() / "comm") >> name;
      if (!name.starts_with("llvmpipe-")) continue;
      ++drawing;
      const auto thread = static_cast<id_t>(std::stoul(task.path().filename().string()));
      yielding += ::getpriority(PRIO_PROCESS, thread) >= 10 ? 1 : 0;
    }
  });
  EXPECT_EQ(yielding, drawing);
}

}  // namespace previz::rig::live_test
