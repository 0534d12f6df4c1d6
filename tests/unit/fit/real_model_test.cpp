// Tests which parts of a scene are edges of the real world.
#include "tests/support/real_bodies.hpp"

namespace previz::real_model_test {

using test::RealScene;

const auto cube = test::box(test::cube_low, test::cube_size);

TEST(RealModel, HasWhatIsRealAndStandsStill) {
  RealScene real({cube});
  EXPECT_EQ(real.model().edges().size(), 12u);

  real.scene.instances[0].presence = scene::world_real;  // removed
  EXPECT_EQ(real.model().edges().size(), 12u);
  real.scene.instances[0].presence = scene::world_mixed;  // virtual
  EXPECT_TRUE(real.model().edges().empty());

  real = RealScene({cube});
  real.set.objects[0].carrier = "cart";
  EXPECT_TRUE(real.model().edges().empty());
  real = RealScene({cube});
  real.set.objects[0].animation = "swing";
  EXPECT_TRUE(real.model().edges().empty());
}

TEST(RealModel, IsWhereItsInstancesAre) {
  RealScene real({cube});
  real.scene.instances[0].world_from_object[3] = {5, 6, 7, 1};
  const auto model = real.model();
  for (const fit::ModelEdge& edge : model.edges())
    EXPECT_LT(glm::distance(0.5 * (edge.a + edge.b), glm::dvec3(5, 6.1, 7.1)), 0.15);
}

TEST(RealModel, GlassAndCutOutsHideAndHaveNoEdges) {
  RealScene real({cube});
  real.scene.materials[0].transmission = 1;
  EXPECT_TRUE(real.model().edges().empty());
  EXPECT_FALSE(real.model().is_seen({0, -1, 0.1}, {0, 1, 0.1}));
  real.scene.materials[0] = {};
  real.scene.materials[0].alpha_mode = scene::AlphaMode::mask;
  EXPECT_TRUE(real.model().edges().empty());
}

TEST(RealModel, KnowsWhereAThingStandsOnAnother) {
  std::size_t touched = 0;
  const auto model = RealScene({cube, test::table()}).model();
  for (const fit::ModelEdge& edge : model.edges()) {
    const bool stands_there = edge.a.z < 0.01 && edge.b.z < 0.01 && std::abs(edge.a.x) < 1;
    EXPECT_EQ(edge.is_touched, stands_there) << edge.a.x << ' ' << edge.a.y << ' ' << edge.a.z;
    touched += edge.is_touched;
  }
  EXPECT_EQ(touched, 4u);
}

TEST(RealModel, OfNothingHidesNothing) {
  const auto model = RealScene().model();
  EXPECT_TRUE(model.edges().empty());
  EXPECT_TRUE(model.is_seen({0, 0, 1}, {0, 0, 0}));
}

}  // namespace previz::real_model_test
