// What deforms keeps its past: each of its points moves as its own vertices do.
#include "daemon/core/render/world/moved_instances.hpp"
#include "daemon/core/scene/bvh_refit.hpp"
#include "tests/support/averaged_frames.hpp"
#include "tests/support/figure.hpp"

namespace previz::test::deforming_history_test {

constexpr int joints = 3;
constexpr int many = 256;  // samples

// A limb and a ball stand on a floor under a sky, and deform.
struct Figure {
  View view;
  std::uint32_t limb = 0, ball = 0;  // deformations

  Figure() {
    scene::Scene& scene = view.scene;
    const std::uint32_t gray = add_material(scene, diffuse(glm::vec3(0.5f)));
    add(scene, rectangle_mesh(glm::dvec2(20)), gray);
    limb = add_limb(scene, limb_mesh(24, 24, joints), joints, gray, at({-0.5, 0, 0}),
                    scene::world_mixed);
    ball = add_squeezed_ball(scene, squeezed_ball_mesh(0.3, 32, 16), gray, at({0.4, 0, 0.35}),
                             scene::world_mixed);
    see_evenly_lit(view, glm::vec3(0.4f), 0.9);
    view.world_from_camera = look_at({0, -1.8, 1.0}, {0, 0, 0.4});
  }
  // `bend` is the angle between joints, in radians, and the ball's weight.
  std::vector<scene::Shape> shapes(double bend) const {
    std::vector<scene::Shape> result(2);
    result[limb] = bent_limb(view.scene.deformations[limb], bend);
    result[ball].weights = {bend};
    return result;
  }
};

// Each frame turns the top by about half a degree. What the light changes by lets the past count as
// a few frames: with n of them the noise is 1 / sqrt(n + 1) of that of a frame alone, so that 0.7
// says that one does, on average.
TEST(DeformingHistory, StaysWhileAFigureMoves) {
  const Figure figure;
  SetRenderer moving(figure.view), alone(figure.view), reference(figure.view);
  Plate last;
  double bend = 0;
  for (int frame = 0; frame < 12; ++frame) {
    bend = 0.005 * frame;
    moving.deform(figure.shapes(bend));
    last = shown_frame(moving, 1, true);
  }
  for (SetRenderer* each : {&alone, &reference}) each->deform(figure.shapes(bend));
  const Truth truth = truth_of(reference, figure.view.world_from_camera, many);
  EXPECT_LT(off_where(is_covered, last, truth),
            0.7 * off_where(is_covered, shown_frame(alone, 1, false), truth));
}

// Walking, and after a jump, a frame shows nothing of the shape before, beyond half of what a fresh
// start shows.
TEST(DeformingHistory, ShowsNoGhostOfAnotherShape) {
  const Figure figure;
  SetRenderer renderer(figure.view);
  double bend = 0;
  for (int frame = 0; frame < 10; ++frame) {
    bend += frame < 6 ? 0.03 : frame == 6 ? 0.4 : 0.0;
    SetRenderer fresh(figure.view), reference(figure.view);
    for (SetRenderer* each : {&renderer, &fresh, &reference}) each->deform(figure.shapes(bend));
    const Truth truth = truth_of(reference, figure.view.world_from_camera, many);
    const Plate after = shown_frame(renderer, 1, true);
    const Plate begun = shown_frame(fresh, 1, true);
    EXPECT_LT(off_where(is_covered, after, truth), 1.5 * off_where(is_covered, begun, truth))
        << frame;
  }
}

// A bound: no vertex moves further, and not by more than twice what the one does that moves
// furthest. The corners of the boxes around what a joint moves are no further off than that from
// the vertices.
TEST(MostMoved, BoundsHowFarAPointMoves) {
  const Figure figure;
  const scene::Scene& scene = figure.view.scene;
  for (const std::uint32_t which : {figure.limb, figure.ball}) {
    const scene::Deformation& deformation = scene.deformations[which];
    const scene::Mesh& mesh = scene.meshes[deformation.mesh];
    const scene::DeformationReach reach = scene::reach_of(mesh, deformation.joints.size());
    for (const double step : {0.001, 0.02, 0.5}) {
      const scene::Shape before = figure.shapes(0.2)[which];
      const scene::Shape after = figure.shapes(0.2 + step)[which];
      const auto was = scene::deformed(mesh.undeformed, before).positions;
      const auto is = scene::deformed(mesh.undeformed, after).positions;
      double most = 0;
      for (std::size_t v = 0; v < is.size(); ++v)
        most = std::max<double>(most, glm::distance(is[v], was[v]));
      const double bound = scene::most_moved(reach, before, after);
      EXPECT_GE(bound * (1 + 1e-5), most) << step;
      EXPECT_LE(bound, 2 * most) << step;
    }
    EXPECT_EQ(scene::most_moved(reach, figure.shapes(0.2)[which], figure.shapes(0.2)[which]), 0);
  }
}

}  // namespace previz::test::deforming_history_test
