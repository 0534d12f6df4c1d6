// A hand over the tags while the rig runs: the picture stays as it is, the take and a refinement
// know nothing of it.
#include "tests/support/lighting.hpp"
#include "tests/support/live_rig.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::rig::shown_pose_test {

using pipeline::Shot;

constexpr int frames = 12, first_covered = 6, covered = 3;
constexpr std::int64_t interval_ns = 100'000'000;

test::TagScene table() {
  test::TagScene scene;
  scene.lens = test::plain_lens(240, 180, 225);
  scene.tags = {test::flat_tag(0, 0.09, {0, 0.05, 0}), test::flat_tag(1, 0.09, {0.2, -0.05, 0})};
  scene.world_from_camera = test::camera_looking({0.1, -0.5, 0.4}, {0.05, 0.03, 0});
  return scene;
}

bool is_covered(int frame) {
  return frame >= first_covered && frame < first_covered + covered;
}

Frame picture(int index) {
  test::TagScene scene = table();
  if (is_covered(index)) scene.tags.clear();
  test::Sensor sensor;
  sensor.full_well_e = 20000;
  std::mt19937 random(static_cast<unsigned>(index));
  Frame frame = test::expose(test::render(scene), sensor, random);
  frame.sequence = static_cast<std::uint64_t>(index);
  frame.timestamp_ns = frame.arrival_ns = 1'000'000'000'000 + index * interval_ns;
  return frame;
}

class ShownPose : public test::RigLive {
 protected:
  ShownPose() {
    while_shown_ = [this] {
      const std::lock_guard lock(mutex_);
      shots_.push_back(shown_.shot);
    };
  }

  void write_set(const std::string& tracking) {
    std::ostringstream text;
    text << "[observer]\ndriver = \"replay\"\ndevice = \"session\"\n"
            "[light_camera]\ndriver = \"none\"\n[lighting]\nenvironment = \"black.exr\"\n"
            "[[object]]\nname = \"floor\"\nfile = \"floor.gltf\"\npresence = \"phantom\"\n"
            "[[light]]\nname = \"lamp\"\ntype = \"point\"\nemission = [1, 1, 1]\n"
            "position_m = [0, 0, 1]\n[quality]\nsamples = 1\n[recording]\npreroll_s = 0\n"
            "slate = \"12A\"\nreserve_mb = 1\ndirectory = \"takes\"\n"
            "[[button]]\nname = \"record\"\naction = \"record\"\n"
            "[[button]]\nname = \"refine\"\naction = \"refine\"\n"
         << "[tracking]\n"
         << tracking;
    for (const set::Tag& tag : table().tags) {
      const glm::dvec4& at = tag.world_from_tag[3];
      text << "[[tag]]\nid = " << tag.id << "\nsize_m = 0.09\nposition_m = [" << at.x << ", "
           << at.y << ", 0]\n";
    }
    std::ofstream(directory_ / "set.toml") << text.str();
    test::write_square(directory_ / "floor.gltf", 4, 0);
    lighting::write_exr_picture(directory_ / "black.exr", {8, 4, std::vector<glm::vec3>(32)});
    session::SessionInfo info;
    info.set_text = text.str();
    info.observer.emplace();
    info.observer->intrinsics = table().lens;
    session::SessionWriter writer(directory_ / "session", info);
    for (int i = 0; i < frames; ++i) writer.write(picture(i));
    writer.close();
  }

  std::vector<Shot> shots_;  // all that were shown
};

bool is_held(const Shot& shot) {
  return shot.shown_pose && shot.shown_pose->held_s > 0;
}

bool is_tracked(const Shot& shot) {
  return shot.track.pose.has_value();
}

TEST_F(ShownPose, AHandOverTheTagsDoesNotBlink) {
  write_set("hold_s = 3\nhold_error = 0.1\n");  // on a machine of any speed
  Shot refined;
  run([&] {
    until([](const Shown& s) { return s.shot.shown_pose && is_tracked(s.shot); });
    begin_take();
    const auto is_held_in_take = [](const Shown& s) {
      return s.look.state.recording && is_held(s.shot);
    };
    const int first = until(is_held_in_take).count;
    until([&](const Shown& s) { return s.count > first && is_held_in_take(s); });
    press("record");
    until([](const Shown& s) { return !s.look.state.recording && is_held(s.shot); });
    press("refine");
    refined = until_frozen().shot;
  });

  // Once there was a pose, no picture went back to the plate.
  bool began = false;
  int held = 0;
  std::map<std::int64_t, bool> tracked;
  for (const Shot& shot : shots_) {
    began |= shot.untouched.empty();
    if (began) {
      EXPECT_EQ(shot.untouched, "");
    }
    tracked[shot.frame->timestamp_ns] = shot.track.pose.has_value();
    if (!is_held(shot)) continue;
    ++held;
    EXPECT_FALSE(shot.track.pose);
    EXPECT_EQ(shot.track.reason, "no tag in the picture");
    EXPECT_LT(glm::distance(glm::dvec3(shot.shown_pose->world_from_camera[3]),
                            glm::dvec3(table().world_from_camera[3])),
              0.01);
  }
  EXPECT_GE(held, 3);

  // The take says that these frames were lost.
  const session::Session take = session::open_session(take_folder());
  int lost = 0;
  for (const session::TrackRecord& record : take.track) {
    lost += !record.tracked;
    const auto shown = tracked.find(record.timestamp_ns);
    if (shown != tracked.end()) {
      EXPECT_EQ(record.tracked, shown->second);
    }
  }
  EXPECT_GE(lost, 1);

  // A refinement is of the last frame that was tracked, with the pose that was found.
  EXPECT_FALSE(refined.shown_pose);
  EXPECT_TRUE(refined.track.pose);
}

// Without the filter pictures show what was found, and nothing where nothing was.
TEST_F(ShownPose, OffShowsPosesAsTheyAreFound) {
  write_set("smooth = false\nhold_s = 0\n");
  run([&] {
    until([](const Shown& s) { return is_tracked(s.shot); });
    until([](const Shown& s) { return !is_tracked(s.shot); });
    until([](const Shown& s) { return is_tracked(s.shot); });
  });
  for (const Shot& shot : shots_) {
    EXPECT_FALSE(shot.shown_pose);
    EXPECT_EQ(shot.untouched.empty(), shot.track.pose.has_value());
  }
}

}  // namespace previz::rig::shown_pose_test
