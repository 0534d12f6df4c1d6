// A tag is moved while the rig runs: it is named, left out, and used again once it is back or the
// set has its new place.
#include <algorithm>
#include <charconv>

#include "tests/support/lighting.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::rig::moved_tag_live_test {

using testing::HasSubstr;

test::TagScene table(double moved_m = 0) {
  test::TagScene scene;
  scene.lens = test::plain_lens(320, 240, 300);
  scene.tags = {test::flat_tag(0, 0.08, {0, 0, 0}), test::flat_tag(1, 0.08, {0.2, -0.05, 0}),
                test::flat_tag(2, 0.08, {-0.1, 0.15, 0})};
  scene.tags[1].world_from_tag[3].x += moved_m;
  scene.world_from_camera = test::camera_looking({0.1, -0.5, 0.4}, {0.05, 0.03, 0});
  return scene;
}

class MovedTagLive : public test::RigLive {
 protected:
  void write_set_of(const test::TagScene& scene) {
    std::ostringstream text;
    text << "[observer]\ndriver = \"replay\"\ndevice = \"session\"\n"
            "[light_camera]\ndriver = \"none\"\n[lighting]\nenvironment = \"black.exr\"\n"
            "[[object]]\nname = \"floor\"\nfile = \"floor.gltf\"\npresence = \"phantom\"\n"
            "[[light]]\nname = \"lamp\"\ntype = \"point\"\nemission = [1, 1, 1]\n"
            "position_m = [0, 0, 1]\n[quality]\nsamples = 1\n[recording]\npreroll_s = 0\n"
            "slate = \"12A\"\nreserve_mb = 1\ndirectory = \"takes\"\n"
            "[[button]]\nname = \"reload_set\"\naction = \"reload_set\"\n";
    for (const set::Tag& tag : scene.tags) {
      const glm::dvec4& at = tag.world_from_tag[3];
      text << "[[tag]]\nid = " << tag.id << "\nsize_m = 0.08\nposition_m = [" << at.x << ", "
           << at.y << ", 0]\n";
    }
    std::ofstream(directory_ / "set.toml") << text.str();
  }

  // A take of the table in whose frames tag 1 is moved by these distances.
  void write_take(const std::vector<double>& moved_m) {
    write_set_of(table());
    test::write_square(directory_ / "floor.gltf", 4, 0);
    lighting::write_exr_picture(directory_ / "black.exr", {8, 4, std::vector<glm::vec3>(32)});
    session::SessionInfo info;
    info.set_text = test::content_of(directory_ / "set.toml");
    info.observer.emplace();
    info.observer->intrinsics = table().lens;
    session::SessionWriter writer(directory_ / "session", info);
    std::mt19937 random(1);
    for (std::size_t i = 0; i < moved_m.size(); ++i) {
      Frame frame = test::expose(test::render(table(moved_m[i])),
                                 {.full_well_e = 20000, .response = {}}, random);
      frame.sequence = i;
      frame.timestamp_ns = frame.arrival_ns =
          1'000'000'000'000 + std::int64_t(i) * test::small_take_interval_ns;
      writer.write(frame);
    }
    writer.close();
  }

  void run_reporting(const std::function<void()>& script) {
    rig::LiveOptions options;
    options.loop = true;
    options.on_shown = [&](const pipeline::Shot& shot, const live::Look&) {
      const std::lock_guard lock(mutex_);
      used_ = shot.track.pose ? shot.track.pose->tags : std::vector<int>{};
    };
    test::run_crewed(std::move(options), directory_.path(), hand_, script, reports_);
  }

  std::string notice() {
    for (const report::Notice& trouble : reports_.troubles())
      if (trouble.source == "tags") return trouble.text;
    return "";
  }
  // Waits until a picture is shown whose pose is by tag 1 too, or by others only.
  void until_used(bool is_used) {
    const auto used = [&] {
      const std::lock_guard lock(mutex_);
      return used_;
    };
    test::must_come(
        is_used ? "the tag is used" : "others are used",
        [&] {
          const std::vector<int> tags = used();
          return !tags.empty() && (std::ranges::count(tags, 1) > 0) == is_used;
        },
        [&] { return testing::PrintToString(used()) + log_.text(); });
  }
  void until_noticed(bool is_there) {
    test::must_come(
        is_there ? "the tag is named" : "the notice has gone",
        [&] { return notice().empty() != is_there; }, [&] { return log_.text(); });
  }

  std::ostream out_{&log_};
  report::Reports reports_{report::lines_to(out_)};
  std::vector<int> used_;  // for the picture that is shown
};

TEST_F(MovedTagLive, IsNamedAndLeftOutUntilTheSetHasItsPlace) {
  for (const double moved_m : {0.01, 0.04}) {
    std::filesystem::remove_all(directory_ / "session");
    write_take(std::vector<double>(4, moved_m));
    run_reporting([&] {
      until_noticed(true);
      const std::string text = notice();
      EXPECT_THAT(text, HasSubstr("tag 1 is "));
      EXPECT_THAT(text, HasSubstr("`previz calibrate tags TAKE`"));
      EXPECT_THAT(text, testing::Not(HasSubstr("tag 0")));
      double off_mm = 0;
      const std::size_t at = text.find("tag 1 is ") + 9;
      std::from_chars(text.data() + at, text.data() + text.size(), off_mm);
      // kCornerFloorPx at 0.65 m by 300 px of focal length is 0.11 mm: two tags give the pose.
      EXPECT_NEAR(off_mm, 1000 * moved_m, 1) << text;
      until_used(false);
      write_set_of(table(moved_m));
      press("reload_set");
      until_used(true);
      until_noticed(false);
    });
  }
}

TEST_F(MovedTagLive, IsUsedAgainOnceItIsBack) {
  std::vector<double> moved_m(100, 0);  // two seconds there, two seconds away
  std::fill_n(moved_m.begin(), 50, 0.02);
  write_take(moved_m);
  run_reporting([&] {
    until_used(false);
    until_noticed(true);
    until_used(true);
    until_used(false);
    until_used(true);
  });
}

}  // namespace previz::rig::moved_tag_live_test
