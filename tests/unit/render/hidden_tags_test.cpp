// Printed tags that are hidden: what is shown in their place, and that nothing else changes.
#include "tests/support/render_fixture.hpp"

namespace previz::test::hidden_tags_test {

// A tag of 0.4 m lies on a grey floor under an even sky, with what is under it ready. Nothing on
// the floor sees anything but the sky, so the tag lights no pixel but its own.
struct Stage {
  // Its height is so small that no sample meets the shadow of its edge.
  static constexpr double above = 1e-5;
  View view;
  std::vector<scene::Instance> hidden;
  Stage() {
    view.environment = uniform_environment(glm::vec3(0.5f));
    view.calibration = pinhole(48, 36, 0.8);
    view.world_from_camera = look_at({0, -1.5, 1.5}, {0, 0, 0});
    const auto tag = [&](const glm::dvec2& size, double albedo, scene::TagPart part) {
      const std::uint32_t mesh = add_mesh(view.scene, rectangle_mesh(size));
      const std::uint32_t material = add_material(view.scene, diffuse(glm::vec3(albedo)));
      view.scene.instances[add_instance(view.scene, mesh, material, at({0, 0, above}))].tag = part;
    };
    tag({0.4, 0.4}, 0.9, scene::TagPart::printed);
    tag({0.44, 0.44}, 0.3, scene::TagPart::under);
    add(view.scene, rectangle_mesh({4, 4}), diffuse(glm::vec3(0.4)));
    scene::hide_tags(view.scene.instances, false);
    hidden = view.scene.instances;
    scene::hide_tags(hidden, true);
  }
  // Returns whether a pixel shows the tag or what is under it, if only in part.
  bool is_tag(const Pixel& pixel) const {
    const glm::dmat4 camera = glm::inverse(view.world_from_camera);
    glm::dvec2 low(1e9), high(-1e9);
    for (const double x : {-0.22, 0.22})
      for (const double y : {-0.22, 0.22}) {
        const glm::dvec3 p(camera * glm::dvec4(x, y, 0, 1));
        const auto& lens = view.calibration.intrinsics;
        const glm::dvec2 px(lens.fx * p.x / p.z + lens.cx, lens.fy * p.y / p.z + lens.cy);
        low = glm::min(low, px);
        high = glm::max(high, px);
      }
    return pixel.x > low.x - 1 && pixel.x < high.x + 1 && pixel.y > low.y - 1 &&
           pixel.y < high.y + 1;
  }
};

TEST(HiddenTags, ShowWhatIsUnderThemAndLeaveEveryOtherPixelAsItIs) {
  const Stage stage;
  View shown = stage.view, hidden = stage.view;
  hidden.scene.instances = stage.hidden;
  for (const set::Estimator estimator : both_estimators) {
    const render::Layers with = render_clean(shown, 16, up_to_depth(4, estimator)).layers;
    const render::Layers without = render_clean(hidden, 16, up_to_depth(4, estimator)).layers;
    int of_tag = 0;
    for (const Pixel& pixel : pixels_of(48, 36)) {
      EXPECT_EQ(with.diff[pixel.i], glm::vec3(0));
      if (stage.is_tag(pixel)) {
        if (without.mask[pixel.i] < 1) continue;
        ++of_tag;
        // Under an even sky of 0.5 an albedo of 0.3 has the radiance 0.15, but for chance.
        EXPECT_NEAR(without.composite[pixel.i].g, 0.15, 0.02);
      } else {
        EXPECT_EQ(without.mask[pixel.i], 0);
        EXPECT_EQ(without.diff[pixel.i], glm::vec3(0)) << pixel.x << ' ' << pixel.y;
      }
    }
    EXPECT_GT(of_tag, 30);
  }
}

// Rays of a far camera cannot tell the floor from what lies on it; they hit the first of the two.
TEST(HiddenTags, ShowWhatIsUnderThemFromFarAway) {
  Stage stage;
  stage.view.calibration = pinhole(48, 36, 0.03);
  stage.view.world_from_camera = look_at({0, -30, 30}, {0, 0, 0});
  stage.view.scene.instances = stage.hidden;
  const render::Layers layers = render_clean(stage.view, 16, up_to_depth(4)).layers;
  EXPECT_EQ(layers.mask[18 * 48 + 24], 1);
  EXPECT_NEAR(layers.composite[18 * 48 + 24].g, 0.15, 0.02);
}

// A wall beside the tag loses the light of the white paper.
TEST(HiddenTags, TakeTheirLightWithThem) {
  Stage stage;
  const std::uint32_t wall = add_mesh(stage.view.scene, rectangle_mesh({0.6, 0.3}));
  const std::uint32_t grey = add_material(stage.view.scene, diffuse(glm::vec3(0.4)));
  const glm::dmat4 upright =
      at({0, 0.25, 0.15}) * glm::rotate(glm::dmat4(1), std::numbers::pi / 2, {1, 0, 0});
  add_instance(stage.view.scene, wall, grey, upright);
  scene::hide_tags(stage.view.scene.instances, true);
  const render::Layers layers = render_clean(stage.view, 64, up_to_depth(4)).layers;
  double change = 0;
  for (const Pixel& pixel : pixels_of(48, 36))
    if (layers.mask[pixel.i] == 0) change += layers.diff[pixel.i].g;
  EXPECT_LT(change, 0);
}

// A button compiles nothing, builds no tree, and the picture is that of a set that hides tags.
TEST(HiddenTags, AreHiddenByAButtonWithoutATreeOrAPipeline) {
  const Stage stage;
  SetRenderer renderer(stage.view, up_to_depth(4));
  renderer.rendered_clean(4);
  const std::uint32_t needed = renderer.needed();
  const std::uint64_t trees = renderer.counters().built_trees;
  renderer.move(stage.hidden, stage.view.scene.lights);
  const auto hidden = renderer.rendered_clean(4).mixed;
  EXPECT_EQ(renderer.needed(), needed);
  EXPECT_EQ(renderer.counters().built_trees, trees);
  View as_made = stage.view;
  as_made.scene.instances = stage.hidden;
  SetRenderer fresh(as_made, up_to_depth(4));
  EXPECT_EQ(fresh.rendered_clean(4).mixed, hidden);
}

}  // namespace previz::test::hidden_tags_test
