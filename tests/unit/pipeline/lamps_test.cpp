// Lamps that the set declares and the light camera sees shine once, and can be dimmed and removed.
#include <glm/gtc/matrix_transform.hpp>

#include "daemon/core/pipeline/light_stage.hpp"
#include "daemon/core/pipeline/relight.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::pipeline::lamps_test {

using std::numbers::pi;
using test::degree;
using test::towards;

const glm::dvec3 place(0.1, 0.2, 0.3);  // of the light camera
const glm::dvec3 key = towards(170, 50), fill = towards(20, 60);
constexpr double radius = 4 * degree;

LightCameraCalibration small_fisheye() {
  LightCameraCalibration camera = test::fisheye_camera(256);
  camera.world_from_camera[3] = glm::dvec4(place, 1);
  return camera;
}

// A dim room with two lamps.
FramePtr light_frame(std::uint64_t sequence = 0) {
  const auto sky = [&](const glm::dvec3& direction) {
    if (glm::dot(direction, key) > std::cos(radius)) return glm::dvec3(40, 35, 25);
    if (glm::dot(direction, fill) > std::cos(radius)) return glm::dvec3(10, 20, 30);
    return glm::dvec3(0.2);
  };
  Frame frame = *test::photograph(small_fisheye(), sky, 0.02, test::Detail::fine);
  frame.sequence = sequence;
  frame.timestamp_ns = 40'000'000 * static_cast<std::int64_t>(sequence);
  return std::make_shared<Frame>(std::move(frame));
}

set::Set set_with(set::LightMode mode = set::LightMode::image) {
  set::Set set;
  set.lighting.mode = mode;
  set.lighting.unseen = set::UnseenRule::horizon;
  return set;
}

LightPtr light_of(const set::Set& set, const scene::Scene* scene = nullptr) {
  static const FramePtr frame = light_frame();
  LightStage stage(set, small_fisheye(), ObserverCalibration{}, scene);
  stage.see(frame, 0);
  return stage.light();
}

// The green radiance of the environment in a direction.
double green_at(const LightPtr& light, const glm::dvec3& direction) {
  const lighting::EnvironmentMap& map = light->lighting.environment;
  return map.radiance[lighting::texel_index(map.size, glm::vec3(direction))].g;
}

// A real lamp that stands where the light camera sees the key light.
set::Light real_sphere(double distance_m = 1.5) {
  set::Light lamp;
  lamp.name = "key";
  lamp.type = set::LightType::sphere;
  lamp.position = place + distance_m * key;
  lamp.radius_m = distance_m * std::sin(radius);
  lamp.gain_real = 1;
  lamp.captured = lamp.measured = true;
  return lamp;
}

set::Set set_with_real_sphere() {
  set::Set set = set_with();
  set.lights = {real_sphere()};
  return set;
}

// Irradiance of a lamp on a plane at the light camera's place, as a distant disc: that of its
// centre times pi sin^2 of its radius, which is exact for a sphere and a disc that are above the
// plane.
glm::dvec3 irradiance_of(const set::Light& lamp, const glm::dvec3& emission,
                         const glm::dvec3& normal) {
  if (lamp.type == set::LightType::directional)
    return emission * std::max(0.0, glm::dot(-lamp.direction, normal));
  const glm::dvec3 to_lamp = lamp.position - place;
  const double sine = lamp.radius_m / glm::length(to_lamp);
  return emission * (pi * sine * sine) * std::max(0.0, glm::dot(glm::normalize(to_lamp), normal));
}

glm::dvec3 irradiance_of(const std::vector<set::Light>& lamps, bool mixed,
                         const glm::dvec3& normal) {
  glm::dvec3 sum(0);
  for (const set::Light& lamp : lamps)
    sum += (mixed ? lamp.gain_mixed * lamp.tint : glm::dvec3(lamp.gain_real)) *
           irradiance_of(lamp, lamp.emission, normal);
  return sum;
}

// A map's texel of 0.9 degrees and the picture's pixel of 0.8 spread a lamp's edge; over a disc of
// 4 degrees the cosine to the plane varies by at most tan(45 degrees) * 0.07 about its middle, and
// a spread that is even to both sides cancels in the first order: 0.07^2 is left.
constexpr double spread = 0.005;

void expect_near(const glm::dvec3& found, const glm::dvec3& expected, double share) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c] / expected[c], 1, share) << "channel " << c;
}

// The whole light is what it was, in both worlds: nothing shines twice and nothing is lost.
TEST(DeclaredLamp, ShinesOnce) {
  const LightPtr whole = light_of(set_with());
  set::Set set = set_with_real_sphere();
  const LightPtr parted = light_of(set);
  ASSERT_TRUE(parted->lamps.empty());
  ASSERT_EQ(parted->emissions.size(), 1u);
  for (const glm::dvec3& normal : {key, glm::normalize(key + fill), glm::dvec3(0, 0, 1)}) {
    const glm::dvec3 rest = irradiance(parted->lighting.environment, normal);
    const glm::dvec3 lamp = irradiance_of(set.lights[0], parted->emissions.at("key"), normal);
    expect_near(rest + lamp, irradiance(whole->lighting.environment, normal), spread);
  }
  // What is left in its place is the room; the emission is that of the picture.
  EXPECT_NEAR(green_at(parted, key), 0.2, 0.01);
  // The pixels that the disc's edge crosses are means of 8x8 directions: their error is far below
  // the 2 % that noise of the merge and the ring of 0.2 in 40 bring.
  expect_near(parted->emissions.at("key"), {40, 35, 25}, 0.02);
}

// Every kind of lamp sends the light camera what it sees.
TEST(DeclaredLamp, OfEveryKindIsMeasured) {
  const LightPtr whole = light_of(set_with());
  const double cap = 2 * pi * (1 - std::cos(radius));
  const glm::dvec3 flux = cap * glm::dvec3(39.8, 34.8, 24.8);
  set::Light lamp = real_sphere(2);
  lamp.direction = -key;
  lamp.up = glm::normalize(glm::cross(key, glm::dvec3(0, 1, 0)));
  const auto measured = [&](set::LightType type) {
    lamp.type = type;
    set::Set set = set_with();
    set.lights = {lamp};
    return light_of(set)->emissions.at("key");
  };
  expect_near(measured(set::LightType::point), flux * 4.0, 0.02);
  lamp.outer_cone_rad = 30 * degree;
  expect_near(measured(set::LightType::spot), flux * 4.0, 0.02);
  lamp.angular_radius_rad = radius;
  const double sine = std::sin(radius);
  expect_near(measured(set::LightType::directional), flux * (pi * sine * sine / cap), 0.02);
  lamp.width_m = lamp.height_m = 0.3;
  // A square of 0.3 m at 2 m, seen from its middle: 4 asin(sin^2 of half its width's angle).
  const double half = std::sin(std::atan(0.075));
  expect_near(measured(set::LightType::rectangle), flux / (4 * std::asin(half * half)), 0.02);
}

// A lamp whose back is towards the light camera cannot be measured; that is said.
TEST(DeclaredLamp, ThatShinesElsewhereIsNotMeasured) {
  set::Set set = set_with_real_sphere();
  set.lights[0].type = set::LightType::spot;
  set.lights[0].direction = key;
  const LightPtr light = light_of(set);
  EXPECT_EQ(light->emissions.at("key"), glm::dvec3(0)) << "no brightness is made up";
  EXPECT_THAT(light->lighting.report.notes,
              Contains(HasSubstr("faces away from the light camera")));
}

// A lamp with a stated emission keeps it, and its light is taken out all the same.
TEST(DeclaredLamp, WithAStatedEmissionKeepsIt) {
  set::Set set = set_with_real_sphere();
  set.lights[0].measured = false;
  const LightPtr light = light_of(set);
  EXPECT_TRUE(light->emissions.empty());
  EXPECT_LT(green_at(light, key), 0.21);
  EXPECT_GT(green_at(light, fill), 15);
}

// A tape measure is not that exact: half of the lamp outside of its outline is taken too.
TEST(DeclaredLamp, AsideOfItsPlaceIsTakenWhole) {
  set::Set set = set_with_real_sphere();
  const glm::dvec3 aside = glm::normalize(glm::cross(key, glm::dvec3(0, 0, 1)));
  set.lights[0].position += 1.5 * std::tan(2.5 * degree) * aside;
  const LightPtr light = light_of(set);
  const LightPtr whole = light_of(set_with());
  const glm::dvec3 taken =
      total_flux(whole->lighting.environment) - total_flux(light->lighting.environment);
  expect_near(taken, 2 * pi * (1 - std::cos(radius)) * glm::dvec3(39.8, 34.8, 24.8), 0.02);
}

set::CapturedLamp captured_key() {
  set::CapturedLamp lamp;
  lamp.name = "window";
  lamp.direction = key;
  lamp.cone_rad = 7 * degree;
  return lamp;
}

TEST(DeclaredLamp, OfARemovedObjectTakesItsLightAlong) {
  scene::Scene scene;
  scene::Mesh mesh;
  mesh.positions = {{-0.1f, -0.1f, -0.1f}, {0.1f, -0.1f, 0.1f}, {0.1f, 0.1f, 0.1f}};
  mesh.triangles = {{0, 1, 2}};
  scene.meshes = {mesh};
  scene::Material glow;
  glow.emission = glm::vec3(5);
  scene.materials = {glow};
  scene::Instance bulb;
  bulb.presence = scene::world_real;
  bulb.world_from_object = glm::translate(glm::dmat4(1), place + 1.5 * key);
  scene.instances = {bulb};
  set::Set set = set_with();
  set.objects.resize(1);
  set.objects[0].name = "ugly lamp";
  set.objects[0].presence = set::Presence::removed;
  EXPECT_LT(green_at(light_of(set, &scene), key), 0.21);
  // A virtual one is not in the light camera's picture; one around the camera covers all of it, and
  // one that moves is not where the file has it.
  const auto expect_nothing_is_taken = [&] {
    const LightPtr other = light_of(set, &scene);
    EXPECT_EQ(other->lighting.environment.radiance,
              light_of(set_with())->lighting.environment.radiance);
  };
  scene.instances[0].presence = scene::world_mixed;
  expect_nothing_is_taken();
  scene.instances[0].presence = scene::world_real;
  set.objects[0].animation = "swing";
  expect_nothing_is_taken();
  set.objects[0].animation.clear();
  for (glm::vec3& corner : scene.meshes[0].positions) corner *= 30;
  expect_nothing_is_taken();
  EXPECT_EQ(claims_of(set, &scene, place).troubles,
            std::vector<std::string>{"the light of \"ugly lamp\" is not subtracted from the "
                                     "environment light: it encloses the light camera"});
}

// A narrow lamp in the middle of a wide claim is its own.
TEST(DeclaredLamp, InsideAWiderClaimIsItsOwn) {
  set::Set set = set_with();
  set.captured_lamps = {captured_key()};
  set.captured_lamps[0].cone_rad = 20 * degree;
  set.lights = {real_sphere()};
  const LightPtr light = light_of(set);
  expect_near(light->emissions.at("key"), {40, 35, 25}, 0.02);
  // What is left of the wide one is noise above the mean of its ring.
  EXPECT_LT(irradiance_of(relit(*light, set, {}), true, key).g,
            0.01 * irradiance_of(set.lights[0], light->emissions.at("key"), key).g);
}

// Dimmed to a third, the mixed world's light falls by two thirds of the lamp's, and the real
// world's stays; with gain 0 the lamp is gone.
TEST(CapturedLamp, IsDimmedInTheMixedWorldAlone) {
  const LightPtr whole = light_of(set_with());
  const glm::dvec3 normal = glm::normalize(key + fill);
  const glm::dvec3 all = irradiance(whole->lighting.environment, normal);
  const double sine = std::sin(radius);
  const glm::dvec3 share = pi * sine * sine * glm::dot(key, normal) * glm::dvec3(39.8, 34.8, 24.8);
  for (const set::LightMode mode :
       {set::LightMode::image, set::LightMode::hybrid, set::LightMode::sources})
    for (const double gain : {1.0, 0.33, 0.0}) {
      SCOPED_TRACE(gain);
      set::Set set = set_with(mode);
      set.captured_lamps = {captured_key()};
      set.captured_lamps[0].gain_mixed = gain;
      const LightPtr light = light_of(set);
      const std::vector<set::Light> lamps = relit(*light, set, {});
      const glm::dvec3 rest = irradiance(light->lighting.environment, normal);
      // A blurred rest has other texels at the plane's horizon: of 0.2 pi within 14 degrees.
      const double more = mode == set::LightMode::sources ? 0.01 : 0;
      expect_near(rest + irradiance_of(lamps, false, normal), all, spread + more);
      // The disc that stands for the lamp has its flux; that is known to 2 % (ShinesOnce).
      expect_near(rest + irradiance_of(lamps, true, normal), all - (1 - gain) * share, 0.02 + more);
    }
}

TEST(CapturedLamp, IsTintedInTheMixedWorldAlone) {
  set::Set set = set_with();
  set.captured_lamps = {captured_key()};
  const LightPtr plain = light_of(set);
  set.captured_lamps[0].tint = {1, 0.7, 0.4};
  const std::vector<set::Light> lamps = relit(*light_of(set), set, {});
  const glm::dvec3 real = irradiance_of(lamps, false, key);
  expect_near(real, irradiance_of(relit(*plain, set, {}), false, key), 1e-12);
  expect_near(irradiance_of(lamps, true, key), real * glm::dvec3(1, 0.7, 0.4), 1e-12);
}

// A lamp whose place is given shines from there.
TEST(CapturedLamp, WithAPlaceIsASphereThere) {
  set::Set set = set_with();
  set.captured_lamps = {captured_key()};
  set.captured_lamps[0].position = place + 2.0 * key;
  const LightPtr light = light_of(set);
  ASSERT_EQ(light->lamps.size(), 1u);
  EXPECT_EQ(light->lamps[0].type, set::LightType::sphere);
  EXPECT_EQ(light->lamps[0].name, "window");
  EXPECT_LT(glm::length(light->lamps[0].position - *set.captured_lamps[0].position), 0.02);
}

// What a take recorded has all lamps, and the set takes its own out of that.
TEST(CapturedLamp, IsTakenOutOfARecordingToo) {
  set::Set set = set_with(set::LightMode::sources);
  const LightPtr plain = light_of(set);
  set.captured_lamps = {captured_key()};
  const LightPtr parted = light_of(set);
  EXPECT_EQ(parted->record.sources.size(), plain->record.sources.size());
  set.lighting.from = set::LightFrom::recording;
  LightStage recorded(set, small_fisheye(), ObserverCalibration{});
  for (const LightPtr& light : {plain, parted}) {
    Shot shot;
    shot.recorded_light = std::make_shared<const session::CapturedLight>(light->record);
    const LightPtr again = recorded.light_for(shot);
    ASSERT_EQ(again->lamps.size(), 2u);
    EXPECT_EQ(std::ranges::count(again->lamps, "window", &set::Light::name), 1);
  }
}

session::SceneState changed(const glm::dvec3& towards, double gain) {
  session::SceneState state;
  session::LightState lamp;
  lamp.direction = -towards;
  lamp.gain_mixed = gain;
  state.lights["found 7"] = lamp;
  return state;
}

// Nobody has declared it: it is found, and what the crew changes is meant by its direction.
TEST(FoundLamp, IsDimmedWhereItIs) {
  const set::Set set = set_with(set::LightMode::hybrid);
  const LightPtr light = light_of(set);
  ASSERT_EQ(light->lamps.size(), 2u);
  ASSERT_EQ(found_lamps(*light).size(), 2u);
  const session::SceneState state = changed(towards(171, 51), 0.25);
  const std::vector<set::Light> lamps = relit(*with_lamps_parted(light, set, state), set, state);
  ASSERT_EQ(lamps.size(), 2u);
  for (const set::Light& lamp : lamps) {
    EXPECT_EQ(lamp.gain_real, 1);
    EXPECT_EQ(lamp.gain_mixed, glm::dot(-lamp.direction, key) > 0.9 ? 0.25 : 1);
  }
  EXPECT_TRUE(unmatched(*light, set, state).empty());
  EXPECT_EQ(unmatched(*light, set, changed(towards(90, 10), 0.5)).size(), 1u);
}

// A light by the whole image has its lamps in the image until somebody changes one.
TEST(FoundLamp, IsTakenOutOfTheImageOnceItIsChanged) {
  const set::Set set = set_with();
  const LightPtr light = light_of(set);
  EXPECT_TRUE(light->lamps.empty());
  ASSERT_EQ(found_lamps(*light).size(), 2u);
  EXPECT_EQ(with_lamps_parted(light, set, {}), light);
  const session::SceneState state = changed(key, 0.25);
  const LightPtr parted = with_lamps_parted(light, set, state);
  ASSERT_EQ(parted->lamps.size(), 1u);
  EXPECT_EQ(found_lamps(*parted), found_lamps(*light)) << "names or order changed";
  EXPECT_EQ(with_lamps_parted(parted, set, state), parted);
  const glm::dvec3 normal = key;
  expect_near(irradiance(parted->lighting.environment, normal) +
                  irradiance_of(relit(*parted, set, state), false, normal),
              irradiance(light->lighting.environment, normal), spread);
  // The other one is where it was.
  const std::size_t there =
      lighting::texel_index(light->lighting.environment.size, glm::vec3(fill));
  EXPECT_EQ(parted->lighting.environment.radiance[there],
            light->lighting.environment.radiance[there]);
}

// The map of a set with a room is seen from the stage, but a set file has the light camera's
// directions.
TEST(FoundLamp, IsKnownAsTheLightCameraSeesIt) {
  set::Set set = set_with();
  set::Room& room = set.lighting.room.emplace();
  room.size_m = {6, 5, 4};
  room.world_from_room[3] = glm::dvec4(place, 1);
  room.seen_from = place + glm::dvec3(0.5, -0.4, -0.3);
  const LightPtr light = light_of(set);
  const std::vector<FoundLamp> found = found_lamps(*light);
  ASSERT_EQ(found.size(), 2u);
  for (const FoundLamp& lamp : found) {
    const glm::dvec3 known = glm::dot(lamp.from_camera, key) > 0.5 ? key : fill;
    EXPECT_GT(glm::dot(lamp.from_camera, known), std::cos(0.5 * degree)) << lamp.name;
    EXPECT_LT(glm::dot(lamp.direction, known), std::cos(5 * degree)) << lamp.name;
  }
}

// A change means the lamp nearest to where it was made, and no two changes mean the same lamp.
TEST(FoundLamp, IsMeantOnce) {
  const std::vector<FoundLamp> lamps = {{"found 1", towards(0, 40), 3 * degree},
                                        {"found 2", towards(6, 40), 3 * degree}};
  using Meant = std::vector<std::optional<std::size_t>>;
  EXPECT_EQ(lamps_meant({towards(5, 40), towards(4, 40)}, lamps), (Meant{1, 0}));
  EXPECT_EQ(lamps_meant({towards(4, 40), towards(5, 40)}, {lamps[1]}), (Meant{{}, 0}));
  // One that is switched off does not hand its change to a window beside it.
  EXPECT_EQ(lamps_meant({towards(0, 40)}, {{"found 1", towards(40, 40), 10 * degree}}),
            (Meant{std::nullopt}));
}

// Noise of the frames, other lamps, lamps that were off for a while: the name stays.
TEST(FoundLamp, KeepsItsNameFromLightFrameToLightFrame) {
  const set::Set set = set_with();
  LightStage stage(set, small_fisheye(), ObserverCalibration{});
  stage.see(light_frame(0), 0);
  const std::vector<FoundLamp> first = found_lamps(*stage.light());
  stage.see(light_frame(1), 1);
  const std::vector<FoundLamp> second = found_lamps(*stage.light());
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].name, "found 1");
  EXPECT_EQ(first[1].name, "found 2");
  ASSERT_EQ(second.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(first[i].name, second[i].name);
    EXPECT_GT(glm::dot(first[i].direction, second[i].direction), std::cos(0.1 * degree));
  }
}

}  // namespace previz::pipeline::lamps_test
