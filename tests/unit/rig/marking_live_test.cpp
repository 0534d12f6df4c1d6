// A crew that marks corners while it records: what the display shows, and what the take has.
#include <atomic>

#include "daemon/core/session/marks.hpp"
#include "drivers/plate.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/pages.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::rig::marking_live_test {

using output::OsdPage;
using test::says;

constexpr int width = 320, height = 240;

class RigMarking : public test::RigLive {
 protected:
  RigMarking() {
    options_.on_screen = [this](const Plate& screen, const OsdPage& page) {
      orange_ = orange_pixels(screen);
      pages_.show(page);
    };
  }

  // A take whose pictures show tags, from two places.
  void write_take(const std::vector<int>& tags) {
    session::SessionInfo info;
    info.set_text =
        "[set]\nname = 'box'\n[observer]\ndriver = 'replay'\ndevice = 'session'\n"
        "[light_camera]\ndriver = 'none'\n[tracking]\nenabled = false\n[lighting]\nfrom = "
        "'set'\n[quality]\nsamples = 1\n[recording]\nslate = '12A'\nreserve_mb = 1\n"
        "directory = 'takes'\n[display]\ndriver = 'headless'\nmode = '640x480'\n" +
        test::button_for_every_action();
    std::ofstream(directory_ / "set.toml") << info.set_text;
    info.observer.emplace();
    info.observer->intrinsics = test::plain_lens(width, height, 400);
    session::SessionWriter writer(directory_ / "session", info);
    for (int i = 0; i < 6; ++i) {
      Frame frame = test::small_take_frame(i);
      frame.format = PixelFormat::rgb8;
      frame.width = width, frame.height = height;
      frame.bytes.assign(frame_bytes(frame.format, width, height),
                         static_cast<std::uint8_t>(40 * i));
      frame.timestamp_ns = frame.arrival_ns = 1'000'000 + i * test::small_take_interval_ns;
      writer.write(frame);
      session::TrackRecord record;
      record.frame = frame.sequence;
      record.timestamp_ns = frame.timestamp_ns;
      record.tracked = true;
      record.tags = tags;
      record.world_from_camera = {
          {1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}, {i < 3 ? 0 : 1, 0, 1, 1}};
      writer.write(record);
    }
    writer.close();
  }

  session::Marks marks_of_the_take() {
    session::Session session = session::open_session(take_folder());
    const auto stream = session::open_stream(session, "observer");
    return session::read_marks(take_folder(), stream->records());
  }

  // Returns how many pixels of the screen have the colour of the cross.
  static int orange_pixels(const Plate& screen) {
    int count = 0;
    for (std::size_t i = 0; i + 2 < screen.samples.size(); i += 3)
      count += screen.samples[i] > 240 && screen.samples[i + 1] > 130 &&
               screen.samples[i + 1] < 170 && screen.samples[i + 2] < 60;
    return count;
  }

  // Presses `mark` and returns the times between which the marked picture was shown.
  std::pair<std::int64_t, std::int64_t> mark(const std::string& answer) {
    const std::int64_t before = shown_now().shot.frame->timestamp_ns;
    press("mark");
    until_said(answer);
    return {before, shown_now().shot.frame->timestamp_ns};
  }

  std::atomic<int> orange_ = 0;  // on the screen now
  test::Pages pages_;
};

TEST_F(RigMarking, KeepsMarksInTheTakeAtTheMiddleOfTheShownPicture) {
  write_take({0});
  std::vector<std::pair<std::int64_t, std::int64_t>> times;
  run([&] {
    press("mark");
    until_said("aim the cross at box 1 corner 1");
    press("mark");
    until_said("marks are kept in a take");
    begin_take();
    until_more(2);
    times.push_back(mark("box 1 corner 1: marked once"));
    mark("box 1 corner 2: marked once");
    press("unmark");
    until_said("box 1 corner 2: mark withdrawn, not marked");
    press("next_box");
    times.push_back(mark("box 2 corner 1: marked once"));
    until_more(2);
    end_take();
  });
  const session::Marks marks = marks_of_the_take();
  EXPECT_THAT(marks.missing, testing::IsEmpty());
  ASSERT_EQ(marks.marks.size(), 2u);
  EXPECT_EQ(marks.marks[0].point, "box 1 corner 1");
  EXPECT_EQ(marks.marks[1].point, "box 2 corner 1");
  const std::vector<session::FrameRecord> pictures = test::unbroken(take_folder());
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(marks.marks[i].px, glm::dvec2(159.5, 119.5));
    const std::int64_t time = pictures.at(marks.marks[i].picture).timestamp_ns;
    EXPECT_GE(time, times[i].first);
    EXPECT_LE(time, times[i].second);
  }
}

TEST_F(RigMarking, ShowsTheCrossOverTheLivePictureAlone) {
  write_take({0});
  run([&] {
    until_more(2);
    EXPECT_EQ(orange_, 0);
    press("marking");
    test::must_come("the cross is there", [&] { return orange_ > 20; });
    press("guides");  // both
    pages_.until([](const OsdPage& page) { return says(page.notices, "guides on"); });
    test::must_come("the cross is there", [&] { return orange_ > 20; });
    press("guides");
    press("refine");
    until_mode(live::Mode::refine);
    test::must_come("the cross is gone", [&] { return orange_ == 0; });
    press("live");
    test::must_come("the cross is there", [&] { return orange_ > 20; });
    press("marking");
    test::must_come("the cross is gone", [&] { return orange_ == 0; });
  });
}

TEST_F(RigMarking, NeedsATagInThePicture) {
  write_take({});
  run([&] {
    press("marking");
    begin_take();
    until_more(1);
    press("mark");
    until_said("not marked: no tag in the picture shows where the camera is (refused)");
    end_take();
  });
  EXPECT_TRUE(marks_of_the_take().marks.empty());
}

}  // namespace previz::rig::marking_live_test
