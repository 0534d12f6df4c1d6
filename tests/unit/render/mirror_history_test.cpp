// What mirrors and glass show keeps its past while the camera moves: it moves as the place that is
// seen in them does, and not as their own surface.
#include "tests/support/averaged_frames.hpp"

namespace previz::test::mirror_history_test {

constexpr int many = 128;  // samples, whose noise is a third of that of a dozen

// Virtual light from one side falls on a real floor with real boxes, among which stands what
// mirrors.
struct Room {
  View view;
  std::uint32_t mirror = 0, box = 0;

  Room(scene::Mesh mesh, const scene::Material& material) {
    scene::Scene& scene = view.scene;
    const std::uint32_t gray = add_material(scene, diffuse(glm::vec3(0.5f)));
    const std::uint32_t red = add_material(scene, diffuse(glm::vec3(0.6f, 0.1f, 0.1f)));
    add(scene, rectangle_mesh(glm::dvec2(20)), gray);
    const std::uint32_t boxes = add_mesh(scene, box_mesh(glm::dvec3(0.3)));
    add_instance(scene, boxes, red, at({-0.8, 0.3, 0.15}));
    box = add_instance(scene, boxes, red, at({0.7, -0.3, 0.15}), scene::world_mixed);
    mirror = add(scene, std::move(mesh), material, at({0, 0, 0.5}), scene::world_mixed);
    see_evenly_lit(view, glm::vec3(0.4f), 0.9);
    view.world_from_camera = look_at({0, -2, 1.2}, {0, 0, 0.4});
  }
};

Room room_with(const std::string& kind) {
  if (kind == "MirrorBox") return {box_mesh(glm::dvec3(0.8)), metal(glm::vec3(0.9f), 0)};
  if (kind == "MirrorBall") return {icosphere_mesh(0.5, 5), metal(glm::vec3(0.9f), 0)};
  return {icosphere_mesh(0.5, 5), glass(1.5f)};
}

glm::dmat4 moving_pose(int frame) {
  return look_at({0.02 * frame, -2 + 0.01 * frame, 1.2}, {0.01 * frame, 0, 0.4});
}

class MirrorHistory : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Of, MirrorHistory, ::testing::Values("MirrorBox", "MirrorBall", "Glass"),
                         [](const auto& of) { return of.param; });

// A dozen samples leave a noise of 1 / sqrt(12) of one, of which half more is allowed for what
// moves out of sight and for interpolating.
TEST_P(MirrorHistory, StaysWhileTheCameraMoves) {
  const Room room = room_with(GetParam());
  SetRenderer moving(room.view), alone(room.view), reference(room.view);
  glm::dmat4 pose(1.0);
  Plate last;
  for (int frame = 0; frame < 12; ++frame) {
    pose = moving_pose(frame);
    last = shown_frame(moving, pose, 1, true);
  }
  const Truth truth = truth_of(reference, pose, many);
  const double off_alone = off_where(is_covered, shown_frame(alone, pose, 1, false), truth);
  const double off = off_where(is_covered, last, truth);
  EXPECT_LT(off, 1.5 / std::sqrt(12.0) * off_alone);
}

// A box walks beside a mirror by a centimetre a frame. What the mirror shows of everything else
// keeps its past; all of it had ended as soon as something moved in a mirror's sight.
TEST_P(MirrorHistory, StaysWhileSomethingWalksBesideIt) {
  const Room room = room_with(GetParam());
  SetRenderer walking(room.view), alone(room.view), reference(room.view);
  std::vector<scene::Instance> instances = room.view.scene.instances;
  glm::dmat4 pose(1.0);
  Plate last;
  for (int frame = 0; frame < 12; ++frame) {
    pose = moving_pose(frame);
    instances[room.box].world_from_object = at({0.8 - 0.01 * frame, -0.4, 0.15});
    walking.move(instances, {});
    last = shown_frame(walking, pose, 1, true);
  }
  for (SetRenderer* each : {&alone, &reference}) each->move(instances, {});
  const Truth truth = truth_of(reference, pose, many);
  EXPECT_LT(off_where(is_covered, last, truth),
            0.6 * off_where(is_covered, shown_frame(alone, pose, 1, false), truth));
}

// Nothing is seen in it of where a box has been that has jumped, beyond half of what a fresh start
// shows.
TEST_P(MirrorHistory, ShowsNoGhostOfWhatHasJumped) {
  const Room room = room_with(GetParam());
  SetRenderer renderer(room.view), fresh(room.view), reference(room.view);
  const glm::dmat4& pose = room.view.world_from_camera;
  std::vector<scene::Instance> instances = room.view.scene.instances;
  for (int frame = 0; frame < 12; ++frame) shown_frame(renderer, pose, 1, true);
  instances[room.box].world_from_object = at({-0.7, -0.5, 0.15});
  for (SetRenderer* each : {&renderer, &fresh, &reference}) each->move(instances, {});
  const Truth truth = truth_of(reference, pose, many);
  for (int frame = 0; frame < 5; ++frame) {
    const Plate after = shown_frame(renderer, pose, 1, true);
    const Plate begun = shown_frame(fresh, pose, 1, true);
    EXPECT_LT(off_where(is_covered, after, truth), 1.5 * off_where(is_covered, begun, truth))
        << frame;
  }
}

// A real mirror on the wall behind a virtual box that shines.
struct MirrorOnTheWall {
  View view;

  MirrorOnTheWall() {
    scene::Scene& scene = view.scene;
    const std::uint32_t gray = add_material(scene, diffuse(glm::vec3(0.5f)));
    scene::Material lamp = diffuse(glm::vec3(0.6f, 0.1f, 0.1f));
    lamp.emission = glm::vec3(0.8f);
    add(scene, rectangle_mesh(glm::dvec2(20)), gray);
    add(scene, box_mesh({4, 0.1, 3}), metal(glm::vec3(0.9f), 0), at({0, 1, 1}));
    add(scene, box_mesh(glm::dvec3(0.3)), lamp, at({0.3, 0.4, 0.15}), scene::world_mixed);
    see_evenly_lit(view, glm::vec3(0.4f), 0.7);
  }
};

// Returns the mean by which what the mirror shows of the shining box is too dark, as a share of its
// brightness over the floor's.
double lacking_of_box(const Plate& picture, const Truth& truth) {
  constexpr int floor = 20000, bright = 36000;
  double lacks = 0, whole = 0;
  for (std::size_t i = 0; i < truth.mask.size(); ++i) {
    const double right = truth.picture.samples[3 * i + 1];
    if (truth.mask[i] > 0 || right < bright) continue;
    lacks += right - picture.samples[3 * i + 1];
    whole += right - floor;
  }
  return lacks / whole;
}

// A side of the box that comes into sight in the mirror has no past of the floor that was seen
// there: it would look as if there were a second outline inside the first one. Of the dozen columns
// that the box has in the mirror one comes into sight every other frame, and filtering may take all
// of it.
TEST(RealMirrorHistory, HasNoSecondOutlineWhileTheCameraMoves) {
  const MirrorOnTheWall room;
  const set::Estimation traced{.caustics = set::Caustics::traced};
  SetRenderer moving(room.view, traced), reference(room.view, traced);
  constexpr int first = 10, frames = 20;
  double lacking = 0;
  for (int frame = 0; frame < frames; ++frame) {
    const glm::dmat4 pose = look_at({0.1 * frame, -1.2, 1.2}, {0.05 * frame - 0.2, 1, 0.1});
    const Plate shown = shown_frame(moving, pose, 1, true, true);
    if (frame < first) continue;
    lacking += lacking_of_box(shown, truth_of(reference, pose, many)) / (frames - first);
  }
  EXPECT_LT(lacking, 1.0 / 12 / 2);
}

}  // namespace previz::test::mirror_history_test
