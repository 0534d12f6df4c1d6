// What changes between frames shortens their past by as much as it must, and where it must: light
// that trembles does not, a lamp that is switched does, and what moves does where it is near.
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/render/world/light_change.hpp"
#include "daemon/core/render/world/moved_instances.hpp"
#include "tests/support/averaged_frames.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::change_test {

using render::least_frames, render::most_frames;

render::EncodedEnvironment sky(double brightness) {
  return render::encode_environment(uniform_environment(glm::vec3(static_cast<float>(brightness))));
}

// A lamp at infinity that the camera estimates, as a source of both worlds.
set::Light found_lamp(double angle_rad, double irradiance) {
  return sun_lamp({std::sin(angle_rad), 0, -std::cos(angle_rad)}, 0.01, glm::dvec3(irradiance));
}

TEST(LightChange, OfTheSameLightIsNone) {
  render::LightChange change;
  change.see(sky(1));
  change.see({found_lamp(0.3, 2)});
  EXPECT_EQ(change.frames(), 0) << "nothing was seen before";
  EXPECT_GT(change.frames(), most_frames);
  change.see(sky(1));
  change.see({found_lamp(0.3, 2)});
  EXPECT_GT(change.frames(), most_frames);
}

// Mains make lamps tremble by 2 %, a camera's estimate of a lamp moves by a milliradian, and a
// source that is hardly one is found in some frames and left in the environment in others.
TEST(LightChange, TremblingDoesNotEndThePast) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> off(-1, 1);
  lighting::EnvironmentMap with = uniform_environment(glm::vec3(1), 32), without = with;
  // The lamp as a texel of the environment, 4 pi / 1024 wide, straight up: with as much irradiance.
  const double texel_sr = 4 * std::numbers::pi / 1024;
  for (const int at : {15 * 32 + 15, 15 * 32 + 16, 16 * 32 + 15, 16 * 32 + 16})
    with.radiance[static_cast<std::size_t>(at)] += glm::vec3(static_cast<float>(1 / texel_sr / 4));
  render::LightChange change;
  for (int frame = 0; frame < 100; ++frame) {
    const double flicker = 1 + 0.02 * off(random);
    const bool is_found = random() % 2 == 0;
    lighting::EnvironmentMap map = is_found ? without : with;
    for (glm::vec3& radiance : map.radiance) radiance *= static_cast<float>(flicker);
    change.see(render::encode_environment(map));
    std::vector<set::Light> lamps;
    if (is_found) lamps.push_back(found_lamp(1e-3 * off(random), flicker));
    change.see(lamps);
    const double frames = change.frames();
    if (frame > 0) {
      EXPECT_GT(frames, most_frames) << frame;
    }
  }
}

TEST(LightChange, ASwitchEndsThePast) {
  const auto frames_after = [](const std::vector<set::Light>& before, double sky_before,
                               const std::vector<set::Light>& after, double sky_after) {
    render::LightChange change;
    for (int frame = 0; frame < 10; ++frame) {
      change.see(sky(sky_before));
      change.see(before);
      change.frames();
    }
    change.see(sky(sky_after));
    change.see(after);
    return change.frames();
  };
  set::Light key = lamp(set::LightType::point, glm::dvec3(3));
  set::Light dimmed = key;
  dimmed.gain_mixed = 0.3 * key.gain_mixed;
  EXPECT_LT(frames_after({key}, 1, {dimmed}, 1), least_frames);
  EXPECT_LT(frames_after({key}, 1, {}, 1), least_frames);
  EXPECT_LT(frames_after({}, 1, {}, 0.1), least_frames);
  EXPECT_LT(frames_after({found_lamp(0, 6)}, 1, {found_lamp(1, 6)}, 1), least_frames)
      << "the sun jumps";
  EXPECT_GT(frames_after({key}, 1, {key}, 1), most_frames);
}

// What is shown is a mean over as many frames as are said to count. Light that grows by 0.2 to 10 %
// a frame is followed to within 3 %, and what is over in a single frame to within what is left of a
// quarter of a frame, which is as good as none.
TEST(LightChange, ASteadyChangeIsFollowed) {
  for (const double rate : {0.002, 0.005, 0.01, 0.03, 0.1}) {
    render::LightChange change;
    double shown = 1, light = 1, count = 0;
    for (int frame = 0; frame < 100; ++frame) {
      light *= 1 + rate;
      change.see(sky(light));
      count = std::min({count, change.frames(), most_frames});
      if (count < least_frames) count = 0;
      shown += (light - shown) / (1 + count);
      count += 1;
      EXPECT_LT((light - shown) / light, 0.03 + 1e-6) << rate << ", frame " << frame;
    }
  }
}

render::GpuScene::Stance box_at(const glm::dvec3& place) {
  render::GpuScene::Stance stance;
  stance.world_from_object = at(place);
  stance.low = glm::vec3(-0.5f);
  stance.high = glm::vec3(0.5f);
  stance.presence = scene::world_mixed;
  return stance;
}

TEST(MovedInstances, AreThoseThatMovedOrBecameOthers) {
  const auto between = [](const render::GpuScene::Stance& before,
                          const render::GpuScene::Stance& now) {
    return render::moved_instances({box_at({5, 0, 0}), before}, {box_at({5, 0, 0}), now},
                                   glm::dvec3(1, 0, 0));
  };
  const render::GpuScene::Stance box = box_at({0, 0, 0});
  EXPECT_TRUE(between(box, box).moved.empty());
  const auto little = between(box, box_at({0.01, 0, 0})).moved;
  ASSERT_EQ(little.size(), 1u);
  EXPECT_EQ(little[0].instance, 1u);
  EXPECT_NEAR(little[0].now.x, 0.01 - 1, 1e-6) << "relative to the camera";
  EXPECT_NEAR(little[0].now.w, std::sqrt(0.75), 1e-6);
  EXPECT_NEAR(little[0].share, 0.01 / std::sqrt(3.0), 1e-6);
  EXPECT_EQ(between(box, box_at({9, 0, 0})).moved[0].share, 1);
  render::GpuScene::Stance other = box;
  other.material = 3;
  EXPECT_EQ(between(box, other).moved[0].share, 1);
  other = box;
  other.deformed = render::GpuScene::Deformed{};
  EXPECT_EQ(between(box, other).moved[0].share, 1);
  other = box;
  other.world_from_object = glm::rotate(glm::dmat4(1.0), 0.2, glm::dvec3(0, 0, 1));
  EXPECT_NEAR(between(box, other).moved[0].turn, 0.2, 1e-7);
  other.may_be_dirac = true;
  EXPECT_GT(between(box, other).throws_caustics, 0);
  EXPECT_EQ(between(box, box_at({1, 0, 0})).throws_caustics, 0);
  EXPECT_EQ(between(box, box_at({9, 0, 0})).rest, 0);
  render::GpuScene::Stance glows = box_at({9, 0, 0});
  glows.emits = true;
  EXPECT_EQ(between(box, glows).rest, 1) << "its light reaches everything";
}

TEST(MovedInstances, BeyondSixteenCountEverywhere) {
  std::vector<render::GpuScene::Stance> before, now;
  for (int i = 0; i < 20; ++i) {
    before.push_back(box_at({2.0 * i, 0, 0}));
    now.push_back(box_at({2.0 * i + 0.01 * (i + 1), 0, 0}));
  }
  const auto result = render::moved_instances(before, now, glm::dvec3(0));
  EXPECT_EQ(result.moved.size(), 16u);
  EXPECT_NEAR(result.rest, 0.04 / std::sqrt(3.0), 1e-6) << "the four that moved least";
}

constexpr int width = averaged_width, height = averaged_height;

// A floor under a sky, a virtual box that stands still on the left, and one that comes and goes on
// the right.
struct TwoBoxes {
  View view;
  std::uint32_t still = 0, walks = 0;

  TwoBoxes() {
    scene::Scene& scene = view.scene;
    const std::uint32_t gray = add_material(scene, diffuse(glm::vec3(0.5f)));
    add(scene, rectangle_mesh(glm::dvec2(20)), gray);
    still = add(scene, box_mesh(glm::dvec3(0.4)), gray, at({-0.9, 0, 0.2}), scene::world_mixed);
    walks = add(scene, box_mesh(glm::dvec3(0.2)), gray, at({0.9, 0, 0.1}), scene::world_mixed);
    see_evenly_lit(view, glm::vec3(0.4f), 1.1);
    view.world_from_camera = look_at({0, -2, 1.4}, {0, 0, 0});
  }
};

Plate shown(SetRenderer& renderer, int samples, bool accumulates) {
  return shown_frame(renderer, samples, accumulates, accumulates);
}

// Returns the rms of what two pictures are apart over columns [first, last).
double apart(const Plate& a, const Plate& b, int first, int last) {
  double off = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    const int x = static_cast<int>(i / 3 % width);
    if (x >= first && x < last) off += std::pow(a.samples[i] - double(b.samples[i]), 2);
  }
  return std::sqrt(off / (3.0 * (last - first) * height));
}

// A box that walks ends the past of what it reaches, and no more. On the left, far from it, there
// is as much noise as if it stood still, of which half as much again is allowed, and before the
// filter no more than a quarter of that of a frame that has just begun, because there are 16
// samples; on the right, where it walks, no more than half as much again as in such a frame.
TEST(LocalHistory, EndsWhereSomethingWalksAndNotElsewhere) {
  const TwoBoxes boxes;
  SetRenderer walking(boxes.view), standing(boxes.view), fresh(boxes.view), reference(boxes.view);
  std::vector<scene::Instance> instances = boxes.view.scene.instances;
  Plate walked, stood;
  for (int frame = 0; frame < 16; ++frame) {
    instances[boxes.walks].world_from_object = at({0.9 - 0.015 * frame, 0.01 * frame, 0.1});
    walking.move(instances, {});
    walked = shown(walking, 1, true);
    stood = shown(standing, 1, true);
  }
  reference.move(instances, {});
  fresh.move(instances, {});
  const Plate truth = shown(reference, 1024, false);
  SetRenderer still_reference(boxes.view);
  const Plate truth_of_standing = shown(still_reference, 1024, false);
  const Plate begun = shown(fresh, 1, true);
  EXPECT_LT(apart(walked, truth, 0, 24), 1.5 * apart(stood, truth_of_standing, 0, 24));
  EXPECT_LT(apart(walking.show(false), truth, 0, 24), apart(fresh.show(false), truth, 0, 24) / 4)
      << "it has a past";
  EXPECT_LT(apart(walked, truth, 36, 64), 1.5 * apart(begun, truth, 36, 64));
}

// A virtual lamp lights the floor without noise, and a box that throws a shadow on it jumps away.
// The past of what the lamp's light is new to is none. A pixel at an outline has other samples than
// in a fresh start, and may be off by more than 2 % of the change: fewer than a third are at one.
TEST(LocalHistory, KeepsNothingOfAShadowThatIsGone) {
  TwoBoxes boxes;
  boxes.view.environment = uniform_environment(glm::vec3(0));
  set::Light key = point_lamp({0.6, 1.2, 0.8}, glm::dvec3(3));
  key.gain_real = 0;
  boxes.view.scene.lights = {key};
  SetRenderer renderer(boxes.view, up_to_depth(1)), fresh(boxes.view, up_to_depth(1));
  Plate before;
  for (int frame = 0; frame < 12; ++frame) before = shown(renderer, 4, true);
  std::vector<scene::Instance> instances = boxes.view.scene.instances;
  instances[boxes.walks].world_from_object = at({0.1, 0.2, 0.1});
  for (SetRenderer* each : {&renderer, &fresh}) each->move(instances, {key});
  const Plate after = shown(renderer, 4, true);
  const Plate begun = shown(fresh, 4, true);
  int changed = 0, off = 0;
  for (std::size_t i = 0; i < after.samples.size(); ++i) {
    const int change = std::abs(before.samples[i] - begun.samples[i]);
    if (change < 1000 || change > 4000) continue;  // the box itself has changed by more
    ++changed;
    off += std::abs(after.samples[i] - begun.samples[i]) > 0.02 * change ? 1 : 0;
  }
  EXPECT_GT(changed, 100);
  EXPECT_LT(3 * off, changed);
}

// Five frames after a jump nothing is seen of where the box was, beyond half of what a fresh start
// shows.
TEST(LocalHistory, ShowsNoGhostOfWhatHasJumped) {
  const TwoBoxes boxes;
  SetRenderer renderer(boxes.view), fresh(boxes.view), reference(boxes.view);
  std::vector<scene::Instance> instances = boxes.view.scene.instances;
  for (int frame = 0; frame < 12; ++frame) shown(renderer, 1, true);
  instances[boxes.walks].world_from_object = at({0.2, 0.3, 0.1});
  for (SetRenderer* each : {&renderer, &fresh, &reference}) each->move(instances, {});
  const Plate truth = shown(reference, 1024, false);
  for (int frame = 0; frame < 5; ++frame) {
    const Plate after = shown(renderer, 1, true);
    const Plate begun = shown(fresh, 1, true);
    EXPECT_LT(apart(after, truth, 28, 64), 1.5 * apart(begun, truth, 28, 64)) << frame;
  }
}

}  // namespace previz::test::change_test
