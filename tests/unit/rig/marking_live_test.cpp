// A crew that marks corners while it records: what the display shows, and what the take has.
#include "daemon/output/guide_page.hpp"
#include "drivers/session/marks.hpp"
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
    options_.on_screen = [this](const Plate&, const OsdPage& page) { pages_.show(page); };
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

  test::Pages pages_;
};

TEST_F(RigMarking, KeepsMarksInTheTakeAtTheMiddleOfTheShownPicture) {
  write_take({0});
  run([&] {
    press("mark");
    until_said("aim the cross at box 1 corner 1");
    press("mark");
    until_said("marks are kept in a take");
    begin_take();
    until_more(2);
    press("mark");
    until_said("box 1 corner 1: marked once");
    press("mark");
    until_said("box 1 corner 2: marked once");
    press("unmark");
    until_said("box 1 corner 2: mark withdrawn, not marked");
    press("next_box");
    press("mark");
    until_said("box 2 corner 1: marked once");
    until_more(2);
    end_take();
  });
  const session::Marks marks = marks_of_the_take();
  EXPECT_THAT(marks.missing, testing::IsEmpty());
  ASSERT_EQ(marks.marks.size(), 2u);
  EXPECT_EQ(marks.marks[0].point, "box 1 corner 1");
  EXPECT_EQ(marks.marks[1].point, "box 2 corner 1");
  for (const session::Marks::Mark& mark : marks.marks) EXPECT_EQ(mark.px, glm::dvec2(159.5, 119.5));
  EXPECT_LE(marks.marks[0].picture, marks.marks[1].picture);
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
