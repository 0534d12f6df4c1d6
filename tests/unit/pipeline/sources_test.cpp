// Light sources from frame to frame, and light from a recording.
#include "daemon/core/pipeline/light_stage.hpp"
#include "daemon/core/pipeline/track_stage.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::pipeline::sources_test {

using test::degree;
using test::towards;

LightCameraCalibration small_fisheye() {
  LightCameraCalibration camera = test::fisheye_camera(128);
  camera.world_from_camera[3] = {0.1, 0.2, 0.3, 1};
  return camera;
}

// A dim room with the lamps that are on; `sequence` tells the time too, 40 ms a frame.
FramePtr light_frame(const std::vector<glm::dvec3>& lamps, std::uint64_t sequence,
                     double exposure = 0.02) {
  const auto sky = [&](const glm::dvec3& direction) {
    for (const glm::dvec3& lamp : lamps)
      if (glm::dot(direction, lamp) > std::cos(4 * degree)) return glm::dvec3(40, 35, 25);
    return glm::dvec3(0.2);
  };
  Frame frame = *test::photograph(small_fisheye(), sky, exposure);
  frame.sequence = sequence;
  frame.timestamp_ns = 40'000'000 * static_cast<std::int64_t>(sequence);
  return std::make_shared<Frame>(std::move(frame));
}

set::Set set_with(set::LightMode mode) {
  set::Set set;
  set.lighting.mode = mode;
  return set;
}

LightPtr after(LightStage& stage, FramePtr frame) {
  const std::uint64_t index = frame->sequence;
  stage.see(std::move(frame), index);
  return stage.light();
}

Shot shot_with(const session::CapturedLight& light) {
  Shot shot;
  shot.recorded_light = std::make_shared<const session::CapturedLight>(light);
  return shot;
}

const glm::dvec3 left = towards(170, 50), right = towards(20, 60);

TEST(SourceStage, ALampThatIsSwitchedOffIsGoneInTheNextLightFrame) {
  LightStage stage(set_with(set::LightMode::hybrid), small_fisheye(), ObserverCalibration{});
  const LightPtr both = after(stage, light_frame({left, right}, 0));
  ASSERT_EQ(both->lamps.size(), 2u);
  const LightPtr one = after(stage, light_frame({right}, 1));
  ASSERT_EQ(one->lamps.size(), 1u);
  EXPECT_GT(glm::dot(-one->lamps[0].direction, right), std::cos(0.5 * degree));
  const auto of_right = std::ranges::max_element(
      both->lighting.sources, {},
      [](const auto& source) { return glm::dot(source.direction, right); });
  EXPECT_EQ(one->lighting.sources[0].id, of_right->id);
  // Nor is it left in the picture: there it is as dark as the room.
  const lighting::EnvironmentMap& map = one->lighting.environment;
  EXPECT_NEAR(map.radiance[lighting::texel_index(map.size, glm::vec3(left))].g, 0.2, 0.01);

  const LightPtr again = after(stage, light_frame({left, right}, 2));
  ASSERT_EQ(again->lighting.sources.size(), 2u);
  EXPECT_EQ(std::max(again->lighting.sources[0].id, again->lighting.sources[1].id), 3);
}

TEST(SourceStage, ANearLampStandsSoFarFromTheLightCamera) {
  set::Set set = set_with(set::LightMode::sources);
  set.lighting.sources.distance_m = 1.5;
  LightStage stage(set, small_fisheye(), ObserverCalibration{});
  const LightPtr light = after(stage, light_frame({left}, 0));
  ASSERT_EQ(light->lamps.size(), 1u);
  const glm::dvec3 expected = glm::dvec3(0.1, 0.2, 0.3) + 1.5 * left;
  EXPECT_LT(glm::length(light->lamps[0].position - expected), 1.5 * 0.5 * degree);
}

// In a room of 6 x 5 x 3 m whose floor is the world's.
TEST(SourceStage, InARoomALampIsOnItsWalls) {
  set::Set set = set_with(set::LightMode::sources);
  set.lighting.room.emplace();
  set.lighting.room->size_m = {6, 5, 3};
  set.lighting.room->world_from_room[3] = {0, 0, 1.5, 1};
  set.lighting.room->seen_from = {0, 0, 0.4};
  LightStage stage(set, small_fisheye(), ObserverCalibration{});
  const LightPtr light = after(stage, light_frame({left, right}, 0));
  ASSERT_EQ(light->lamps.size(), 2u);
  for (const set::Light& lamp : light->lamps) {
    const glm::dvec3 part =
        glm::abs(lamp.position - glm::dvec3(0, 0, 1.5)) / glm::dvec3(3, 2.5, 1.5);
    EXPECT_NEAR(std::max({part.x, part.y, part.z}), 1, 1e-5);
  }
}

// What is rendered from a recording is what was rendered when it was made.
TEST(SourceStage, TheRecordedLightIsTheLightItWasMadeOf) {
  set::Set set = set_with(set::LightMode::sources);
  LightStage stage(set, small_fisheye(), ObserverCalibration{});
  const LightPtr light = after(stage, light_frame({left, right}, 0));

  set.lighting.from = set::LightFrom::recording;
  LightStage recorded(set, small_fisheye(), ObserverCalibration{});
  EXPECT_FALSE(recorded.needs_frames());
  const LightPtr again = recorded.light_for(shot_with(light->record));
  ASSERT_TRUE(again);
  EXPECT_EQ(again->lighting.environment.radiance, light->lighting.environment.radiance);
  EXPECT_EQ(again->lighting.sources, light->lighting.sources);
  ASSERT_EQ(again->lamps.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again->lamps[i].direction, light->lamps[i].direction);
    EXPECT_EQ(again->lamps[i].emission, light->lamps[i].emission);
  }
  EXPECT_EQ(recorded.light_for(shot_with(light->record)), again);  // not made again
  EXPECT_FALSE(recorded.light_for(Shot{}));

  // It has no picture to go back to.
  recorded.use(set::LightMode::image);
  EXPECT_EQ(recorded.light_for(shot_with(light->record)), again);
  ASSERT_EQ(recorded.troubles().size(), 1u);
}

// Whatever lights the picture, a take carries the sources.
TEST(SourceStage, ATakeCarriesTheSourcesOfAnImageToo) {
  LightStage by_image(set_with(set::LightMode::image), small_fisheye(), ObserverCalibration{});
  LightStage by_sources(set_with(set::LightMode::sources), small_fisheye(), ObserverCalibration{});
  const LightPtr image = after(by_image, light_frame({left, right}, 0));
  EXPECT_TRUE(image->lamps.empty());
  EXPECT_EQ(image->record, after(by_sources, light_frame({left, right}, 0))->record);
}

TEST(SourceStage, ARecordingWithoutLightIsRefused) {
  set::Set set = set_with(set::LightMode::sources);
  set.lighting.from = set::LightFrom::recording;
  ObserverCalibration observer;
  observer.intrinsics.width = observer.intrinsics.height = 64;
  observer.intrinsics.fx = observer.intrinsics.fy = 60;
  EXPECT_THROW(TrackStage(set, observer, {session::TrackRecord{}}, 0), Error);
}

TEST(SourceStage, TheSetsOwnLightNeedsNoCamera) {
  set::Set set = set_with(set::LightMode::image);
  EXPECT_THROW(LightStage(set, {}, ObserverCalibration{}), Error);
  set.lighting.from = set::LightFrom::set;
  LightStage stage(set, {}, ObserverCalibration{});
  EXPECT_FALSE(stage.needs_frames());
  EXPECT_EQ(total_flux(stage.light()->lighting.environment), glm::dvec3(0));
}

}  // namespace previz::pipeline::sources_test
