// The lines over a picture, against where a camera shows the things that they are drawn of.
#include "daemon/rig/guides.hpp"

#include "daemon/core/fit/visible_edges.hpp"
#include "tests/support/real_bodies.hpp"

namespace previz::rig::guides_test {

using output::GuideKind;
using output::GuideLine;
using output::GuidePage;
using test::RealScene;

// A cube on a table, seen by a camera of 1280 x 960 px whose principal point is in the middle.
class Guides : public testing::Test {
 protected:
  Guides() { view_.world_from_camera = test::place_of_camera(); }

  GuidePage page() const { return GuideModel(real_.scene, real_.set, camera_).guides_of(view_); }
  std::vector<GuideLine> lines(GuideKind kind) const {
    std::vector<GuideLine> all;
    std::ranges::copy_if(page().lines, std::back_inserter(all),
                         [kind](const GuideLine& line) { return line.kind == kind; });
    return all;
  }
  std::string words(GuideKind kind) const {
    std::string all;
    for (const output::GuideWord& word : page().words)
      if (word.kind == kind) all += word.text + ";";
    return all;
  }
  // A camera that looks along +Y from a metre above the ground, and so far up or down.
  void look_along_y(double up) {
    view_.world_from_camera = test::camera_looking({0, 0, 1}, {0, 1, 1 + up});
  }

  RealScene real_{{test::box(test::cube_low, test::cube_size)}};
  ObserverCalibration camera_ = test::camera_of_tests();
  GuideModel::View view_;
};

TEST_F(Guides, HaveTheEdgesThatTheModelDoesNotHide) {
  const auto segments =
      visible_segments(real_.model(), camera_.intrinsics, view_.world_from_camera);
  const auto drawn = lines(GuideKind::model);
  ASSERT_FALSE(drawn.empty());
  ASSERT_EQ(drawn.size(), segments.size());
  for (std::size_t i = 0; i < drawn.size(); ++i) EXPECT_EQ(drawn[i].a, segments[i].a);
}

TEST_F(Guides, HaveTheTagsThatFaceTheCamera) {
  real_.set.tracking.tags = {test::flat_tag(7, 0.1, {0.3, 0, 0})};
  EXPECT_EQ(words(GuideKind::tag), "7;");
  const auto drawn = lines(GuideKind::tag);
  EXPECT_GE(drawn.size(), 4u);
  for (const glm::dvec3& corner : {glm::dvec3(0.25, -0.05, 0), {0.35, 0.05, 0}}) {
    const glm::dvec2 px = test::shown(corner);
    EXPECT_TRUE(std::ranges::any_of(
        drawn, [&](const GuideLine& line) { return glm::distance(line.a, px) < 1e-6; }));
  }
  real_.set.tracking.tags[0].world_from_tag[2] *= -1;  // now it faces the ground
  EXPECT_EQ(words(GuideKind::tag), "");
}

TEST_F(Guides, HaveTheTagsOfACarrierWhereItWasFound) {
  real_.set.tracking.carriers = {{"tray", {test::flat_tag(9, 0.1, {0, 0, 0})}}};
  EXPECT_EQ(words(GuideKind::tag), "");
  session::CarrierState& tray = view_.carriers["tray"];
  tray.world_from_carrier[3] = {0.1, -0.2, 0.3, 1};
  EXPECT_EQ(words(GuideKind::tag), "");  // that is where it was last
  tray.tags = {9};
  EXPECT_EQ(words(GuideKind::tag), "9;");
  const GuidePage found = page();
  const auto word = std::ranges::find(found.words, GuideKind::tag, &output::GuideWord::kind);
  EXPECT_LT(glm::distance(word->at, test::shown({0.1, -0.2, 0.3})), 1e-6);
}

TEST_F(Guides, HaveTheHorizonFromBorderToBorder) {
  EXPECT_TRUE(lines(GuideKind::horizon).empty());  // the camera looks down
  look_along_y(0.1);
  const double y = camera_.intrinsics.cy + 0.1 * camera_.intrinsics.fy;
  double left = 1e9, right = 0;
  for (const GuideLine& line : lines(GuideKind::horizon)) {
    EXPECT_NEAR(line.a.y, y, 1e-3);
    EXPECT_NEAR(line.b.y, y, 1e-3);
    left = std::min({left, line.a.x, line.b.x});
    right = std::max({right, line.a.x, line.b.x});
  }
  // A line ends within 4 px of where it could, and 4 px from the border.
  EXPECT_LT(left, 8.0);
  EXPECT_GT(right, 1280 - 9.0);
}

TEST_F(Guides, FollowTheLens) {
  look_along_y(0.25);
  camera_.intrinsics.k1 = -0.2;
  const double r2 = 0.25 * 0.25;
  const double y = camera_.intrinsics.cy + 0.25 * (1 - 0.2 * r2) * camera_.intrinsics.fy;
  double middle = 0, side = 1e9;
  for (const GuideLine& line : lines(GuideKind::horizon)) {
    middle = std::max(middle, line.a.y);
    side = std::min(side, line.a.y);
  }
  EXPECT_NEAR(middle, y, 0.1);  // 4 px beside the middle it is 0.001 px higher
  EXPECT_LT(side, y - 5);
}

TEST_F(Guides, HaveTheAxesOfTheWorld) {
  real_ = RealScene();
  for (const auto& [kind, end, name] : {std::tuple{GuideKind::x_axis, glm::dvec3(0.1, 0, 0), "X;"},
                                        {GuideKind::y_axis, glm::dvec3(0, 0.1, 0), "Y;"},
                                        {GuideKind::z_axis, glm::dvec3(0, 0, 0.1), "Z;"}}) {
    const auto drawn = lines(kind);
    ASSERT_FALSE(drawn.empty());
    EXPECT_LT(glm::distance(drawn.front().a, test::shown({0, 0, 0})), 1e-6);
    EXPECT_LT(glm::distance(drawn.back().b, test::shown(end)), 1e-6);
    EXPECT_EQ(words(kind), name);
  }
}

TEST_F(Guides, HaveABoxAroundAVirtualObjectWhereItIs) {
  real_.add(test::box({0.2, 0.1, 0}, {0.1, 0.2, 0.3}), scene::world_mixed);
  real_.set.objects[0].presence = set::Presence::phantom;
  real_.set.objects[1].name = "vase";
  const auto has = [&](const glm::dvec3& corner) {
    return std::ranges::any_of(lines(GuideKind::bounds), [&](const GuideLine& line) {
      return glm::distance(line.a, test::shown(corner)) < 1e-3 ||
             glm::distance(line.b, test::shown(corner)) < 1e-3;
    });
  };
  EXPECT_TRUE(has({0.2, 0.1, 0}));
  EXPECT_TRUE(has({0.3, 0.3, 0.3}));
  EXPECT_FALSE(has(test::cube_low));
  glm::dmat4 moved(1);
  moved[3] = {-0.15, 0, 0, 1};
  view_.scene.objects["vase"] = moved;
  EXPECT_TRUE(has({0.05, 0.1, 0}));
  EXPECT_FALSE(has({0.2, 0.1, 0}));
  view_.scene.objects["vase"] = std::nullopt;  // it is nowhere
  EXPECT_TRUE(lines(GuideKind::bounds).empty());
}

TEST_F(Guides, SayWhereALensIsFocused) {
  EXPECT_TRUE(lines(GuideKind::focus).empty());
  camera_.lens = ThinLens{0.05, 2, 1.234};
  EXPECT_EQ(lines(GuideKind::focus).size(), 2u);
  EXPECT_EQ(words(GuideKind::focus), "focus 1.23 m;");
}

TEST_F(Guides, EndWithinThePicture) {
  real_.add(test::table());
  real_.set.tracking.tags = {test::flat_tag(1, 3, {0, 0, 0})};
  for (const double up : {-0.2, 0.0, 0.2}) {
    look_along_y(up);
    for (const GuideLine& line : page().lines)
      for (const glm::dvec2& p : {line.a, line.b})
        EXPECT_TRUE(p.x >= 0 && p.y >= 0 && p.x <= 1279 && p.y <= 959) << p.x << ' ' << p.y;
  }
}

}  // namespace previz::rig::guides_test
