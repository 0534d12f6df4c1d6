// What the crew sees, from end to end: a replayed take on a headless display that is read back.
#include "daemon/core/output/png.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/pages.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::rig::display_test {

using output::OsdPage;
using test::says;

constexpr int screen_width = 480, screen_height = 270;
constexpr int picture_width = 48, picture_height = 36;  // small_take_frame's
constexpr int left = (screen_width - picture_width) / 2, top = (screen_height - picture_height) / 2;

class RigDisplay : public test::RigLive {
 protected:
  using Pictures = std::deque<std::shared_ptr<const Plate>>;

  RigDisplay() {
    while_shown_ = [this] {
      const std::lock_guard lock(mutex_);
      pictures_.push_back(shown_.shot.picture);
      if (pictures_.size() > 1024) pictures_.pop_front();
    };
    options_.on_screen = [this](const Plate& screen, const OsdPage& page) {
      ++count_;
      pages_.show(page);
      std::unique_lock lock(mutex_);
      const Pictures pictures = pictures_;
      lock.unlock();
      ++(is_a_picture(screen, page, pictures) ? as_expected_ : others_);
    };
  }

  void until_mode(const std::string& mode) {
    pages_.until([&](const OsdPage& page) { return says(page.top_left, mode); }, mode);
  }
  void until_notice(const std::string& words) {
    pages_.until([&](const OsdPage& page) { return says(page.notices, words); }, words);
  }
  // The pages before it are of no interest any more.
  void press(const std::string& button) {
    pages_.skip();
    hand_.press(button);
  }

  // 1:1 in the middle: outside the words' boxes every pixel is one of the pictures handed to the
  // display, most likely the last, or black beside it.
  static bool is_a_picture(const Plate& screen, const OsdPage& page, const Pictures& pictures) {
    const std::vector<Overlay> boxes =
        output::OsdPainter(screen_width, screen_height, 0.05).paint(page);
    const auto found = std::find_if(pictures.rbegin(), pictures.rend(), [&](const auto& picture) {
      return is_the_same(screen, *picture, boxes, left, top, picture_width, picture_height);
    });
    return found != pictures.rend() &&
           is_the_same(screen, **found, boxes, 0, 0, screen_width, screen_height);
  }
  // Within a part of the screen.
  static bool is_the_same(const Plate& screen, const Plate& picture,
                          const std::vector<Overlay>& boxes, int x0, int y0, int width,
                          int height) {
    for (int y = y0; y < y0 + height; ++y)
      for (int x = x0; x < x0 + width; ++x)
        if (!same(screen, picture, x, y) && !covered(boxes, x, y)) return false;
    return true;
  }
  static bool covered(const std::vector<Overlay>& boxes, int x, int y) {
    return std::ranges::any_of(boxes, [&](const Overlay& box) {
      return x >= box.x && x < box.x + box.width && y >= box.y && y < box.y + box.height;
    });
  }
  static bool same(const Plate& screen, const Plate& picture, int x, int y) {
    const int px = x - left;
    const int py = y - top;
    const bool inside = px >= 0 && py >= 0 && px < picture_width && py < picture_height;
    for (int c = 0; c < 3; ++c) {
      const int shown = screen.samples[static_cast<std::size_t>(3 * (y * screen_width + x) + c)];
      const int wanted =
          inside ? picture.samples[static_cast<std::size_t>(3 * (py * picture_width + px) + c)] : 0;
      if (shown != wanted) return false;
    }
    return true;
  }

  test::Pages pages_;
  Pictures pictures_{// what may be seen: black before the first
                     std::make_shared<const Plate>(
                         Plate{picture_width, picture_height, 8,
                               std::vector<std::uint16_t>(3 * picture_width * picture_height, 0)})};
  std::atomic<int> count_ = 0;
  std::atomic<int> as_expected_ = 0, others_ = 0;
};

TEST_F(RigDisplay, ShowsThePictureAndTheWordsOfEveryMode) {
  write_set(
      "[display]\ndriver = \"headless\"\nmode = \"480x270\"\nscale = \"1:1\"\n"
      "text_height = 0.05\n");
  run([&] {
    pages_.until_words("2 samples");
    until_notice("plate only: pose lost");
    press("debug_view");
    until_mode("view: mixed");
    for (std::size_t i = 1; i < render::all_views.size(); ++i) press("debug_view");
    press("record");
    until_mode("● 00:");
    press("refine");
    pages_.until([](const OsdPage& page) {  // the take has its name once its folder is there
      return says(page.bottom_left, "· error") && says(page.top_left, "REFINE") &&
             says(page.top_left, "12A_take001");
    });
    press("live");
    press("standby");  // refused: a take runs
    until_notice("end the take first");
    press("record");
    press("snapshot");
    until_notice("snapshot");
    press("osd");
    pages_.until([](const OsdPage& page) { return page == OsdPage{}; });
    press("osd");
    until_mode("LIVE");
    // It is written by a thread of its own; an end would leave it out.
    test::must_come("the snapshot is there",
                    [&] { return std::filesystem::exists(directory_ / "live/snapshot_0001.exr"); });
  });
  // The words lay over the pictures and changed nothing else, from the first screenful to the last.
  EXPECT_GT(count_, 0);
  EXPECT_EQ(as_expected_, count_);
  EXPECT_GT(metrics_.stages.at("screen").frames, 0u);
  EXPECT_GT(metrics_.latency_p50_s, 0.0);

  // None of them is in what was written.
  const Plate snapshot = output::read_png(directory_ / "live/snapshot_0001.png");
  EXPECT_EQ(snapshot.width, picture_width);
  session::Session take = session::open_session(take_folder());
  const auto stream = session::open_stream(take, "observer");
  for (std::size_t i = 0; i < stream->records().size(); ++i)
    EXPECT_EQ(stream->read(i)->bytes,
              test::small_take_frame(static_cast<int>(stream->records()[i].sequence % 8)).bytes);
  EXPECT_EQ(output::read_png(directory_ / "live/screen.png").width, screen_width);
}

// A device that is treated as a graphics card, and times its passes as one does.
TEST_F(RigDisplay, ShowsWhatEachPassTakesWhileItIsAskedFor) {
  options_.device.as_gpu = options_.device.times_passes = true;
  write_set(
      "[display]\ndriver = \"headless\"\nmode = \"480x270\"\nscale = \"1:1\"\n"
      "text_height = 0.05\n");
  std::vector<output::OsdText> column;
  run_rendering([&] {
    const auto shows_times = [](const std::string& of_what) {
      return [of_what](const OsdPage& page) {
        return says(page.column, of_what) && says(page.column, "computer waits: ");
      };
    };
    pages_.until_words("2 samples");
    press("record");
    press("osd");
    pages_.until([](const OsdPage& page) { return page == OsdPage{}; });
    press("pass_times");
    // The first figures may be those of a part of a frame.
    pages_.until(
        [&](const OsdPage& page) {
          column = page.column;
          return shows_times(" ms per frame")(page) && column.size() == 2 + 7 + 1;
        },
        "the sum, the wait, the longest passes and the others");
    press("refine");
    pages_.until(shows_times(" ms per round"), "rounds' times");
    press("pass_times");
    pages_.until(
        [](const OsdPage& page) { return page.column.empty() && says(page.top_left, "LIVE"); });
    press("record");
    until_said("12A_take001 is finished");
  });
  EXPECT_EQ(as_expected_, count_);
  for (std::size_t i = 2; i < 2 + 7; ++i) {
    const std::string& words = column[i].text;
    EXPECT_TRUE(metrics_.passes.contains(words.substr(0, words.find(": ")))) << words;
    EXPECT_TRUE(words.ends_with(" ms")) << words;
  }
  // What the crew looked at is no part of the take.
  session::Session take = session::open_session(take_folder());
  const auto stream = session::open_stream(take, "observer");
  for (std::size_t i = 0; i < stream->records().size(); ++i)
    EXPECT_EQ(stream->read(i)->bytes,
              test::small_take_frame(static_cast<int>(stream->records()[i].sequence % 8)).bytes);
}

TEST_F(RigDisplay, ShowsLinesOverThePictureOnlyWhileTheGuidesAreOn) {
  write_set(
      "[display]\ndriver = \"headless\"\nmode = \"480x270\"\nscale = \"1:1\"\n"
      "text_height = 0.05\n");
  run_rendering([&] {
    pages_.until_words("2 samples");
    EXPECT_EQ(others_, 0);
    press("guides");
    test::must_come("there are lines", [&] { return others_ > 3; });
    until_notice("model: no figure: ");  // nothing of the small take is real but a table
    press("refine");                     // a frozen picture has them too
    until_mode("REFINE");
    const int before = others_;
    test::must_come("there are lines", [&] { return others_ > before + 1; });
    press("live");
    press("guides");
    until_notice("guides off");
    const int with_lines = others_;
    until_more(10);
    EXPECT_EQ(others_, with_lines);
    press("snapshot");
    until_notice("snapshot");
  });
  EXPECT_EQ(as_expected_ + others_, count_);
}

// What a driver's release() does is seen on a real screen (KmsScreen): here that it comes, once,
// and that nothing is shown between it and the next picture.
TEST_F(RigDisplay, IsReleasedInStandbyAndBackAfterIt) {
  write_set("[display]\ndriver = \"headless\"\nmode = \"480x270\"\n");
  run([&] {
    until_mode("LIVE");
    press("standby");
    int before = 0;
    test::must_come("nothing is shown for ten of the screen's looks at its words", [&] {
      before = count_;
      std::this_thread::sleep_for(std::chrono::seconds(1));
      return count_ == before;
    });
    press("standby");
    until_mode("LIVE");
    EXPECT_GT(count_, before);
  });
  EXPECT_EQ(metrics_.counts.at("screen: released"), 1u);
}

// Two takes of an earlier process that nobody recorded on: the display says so until it was seen.
TEST_F(RigDisplay, TakesThatWereCutOffStandOnItUntilSomebodyTakesNote) {
  write_set("[display]\ndriver = \"headless\"\nmode = \"480x270\"\n");
  for (const char* name : {"12A_take001", "12A_take002"}) {
    const std::filesystem::path take = take_folder(name);
    session::write_small_session(take, 3);
    std::string toml = test::content_of(take / "session.toml");
    const std::string closed = "closed = true";
    toml.replace(toml.find(closed), closed.size(), "closed = false");
    session::replace_file(take / "session.toml", toml);
  }
  const std::string words = "take: 12A_take002 was cut off; it has 3 frames (and 1 more)";
  run([&] {
    until_notice(words);
    std::this_thread::sleep_for(2 * report::Notices::trouble_time);
    for (std::size_t waiting = pages_.unread() + 1; waiting > 0; --waiting)
      EXPECT_TRUE(says(pages_.next().notices, words)) << waiting;
    press("acknowledge");
    pages_.until([&](const OsdPage& page) { return !says(page.notices, words); });
  });
}

TEST_F(RigDisplay, WithoutAScreenTheRigGoesOnAndSaysSoOnce) {
  write_set("[display]\ndriver = \"kms\"\nconnector = \"HDMI-A-9\"\n");
  run([&] { until_more(20); });
  EXPECT_EQ(count_said("retrying until it is available"), 1) << log_.text();
  EXPECT_GT(metrics_.stages.at("screen").dropped.at("no display"), 0u);
}

}  // namespace previz::rig::display_test
