// The plate as the radiance of real surfaces: what mirrors and virtual objects take from it, and
// where it may not be taken.
#include "drivers/calibration/pinhole.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::camera_test {

constexpr int width = 48, height = 36;
constexpr double white = 4;  // of the sensor, whose response is linear with 16 bits
constexpr float albedo = 0.5f;

set::Estimation by_camera(set::Estimator estimator = set::Estimator::paired) {
  return {.estimator = estimator, .real_radiance = set::RealRadiance::camera, .max_depth = 8};
}

// A matt floor in the lower half of the picture, and a virtual mirror in its upper half that leans
// over it, so that what it shows of the floor is in the picture, too.
View floor_and_mirror() {
  View view = empty_view({0, -1.5, 1}, {0, 0.6, 0.3}, pinhole(width, height, 0.9));
  add(view.scene, rectangle_mesh({8, 8}), diffuse(glm::vec3(albedo)));
  glm::dmat4 pose(1);
  // Its back edge at y = 1.5, 0.4 above the floor; it faces the camera and down.
  const double lean = 1.9;
  pose[1] = {0, std::cos(lean), std::sin(lean), 0};
  pose[2] = {0, -std::sin(lean), std::cos(lean), 0};
  pose[3] = {0, 1.5, 0.8, 1};
  add(view.scene, rectangle_mesh({0.8, 0.8}), metal(glm::vec3(1), 0), pose, scene::world_mixed);
  view.calibration.response.kind = ResponseCurve::Kind::linear;
  return view;
}

Plate plate_of(const std::function<glm::dvec3(int x, int y)>& radiance) {
  std::vector<glm::dvec3> layer;
  for (const auto& [x, y, i] : pixels_of(width, height)) layer.push_back(radiance(x, y));
  return linear_plate(width, height, layer, white);
}

Rendered render_over(const View& view, const Plate& plate, const set::Estimation& estimation,
                     int samples = 4) {
  SetRenderer renderer(view, estimation);
  renderer.begin({std::make_shared<const Plate>(plate), 1 / white, view.world_from_camera, 1});
  renderer.render(samples);
  expect_clean(renderer.counters());
  return {renderer.layers(), renderer.counters()};
}

// The pixel on whose middle this one's mirror image falls, if all of the pixel shows the mirror and
// the floor in it; -1, -1: none.
glm::dvec2 mirrored_pixel(const View& view, int x, int y) {
  const PinholeIntrinsics& k = view.calibration.intrinsics;
  const glm::dmat4& camera = view.world_from_camera;
  const glm::dmat4& mirror = view.scene.instances[1].world_from_object;
  const glm::dvec3 eye(camera[3]), normal(mirror[2]), middle(mirror[3]);
  const glm::dvec2 straight = undistort(k, {x, y}).value();
  const glm::dvec3 ray(glm::dmat3(camera) * glm::dvec3(straight, 1));
  const double t = glm::dot(middle - eye, normal) / glm::dot(ray, normal);
  const glm::dvec3 hit = eye + t * ray;
  const glm::dvec2 inside(glm::dot(hit - middle, glm::dvec3(mirror[0])),
                          glm::dot(hit - middle, glm::dvec3(mirror[1])));
  if (t <= 0 || std::max(std::abs(inside.x), std::abs(inside.y)) > 0.35) return {-1, -1};
  const glm::dvec3 reflected = glm::reflect(ray, normal);
  if (reflected.z >= 0) return {-1, -1};
  const glm::dvec3 floor = hit - reflected * (hit.z / reflected.z);
  const glm::dvec3 seen = glm::inverse(glm::dmat3(camera)) * (floor - eye);
  return distort(k, {seen.x / seen.z, seen.y / seen.z});
}

bool is_inside(const glm::dvec2& pixel) {
  return pixel.x > 3 && pixel.y > 3 && pixel.x < width - 4 && pixel.y < height - 4;
}

// The pixels that show nothing but the floor in the mirror.
std::vector<std::size_t> mirrored_pixels(const View& view, const render::Layers& layers) {
  std::vector<std::size_t> pixels;
  for (const auto& [x, y, i] : pixels_of(width, height))
    if (is_inside(mirrored_pixel(view, x, y)) && layers.mask[i] == 1) pixels.push_back(i);
  return pixels;
}

// The floor is dark in the model, and bright in the plate, rising from left to right: the mirror
// shows the plate's floor.
// `where_it_can`: where the floor is seen too flat, the model is traced, which is black.
void expect_mirror_shows_plate(const View& view, bool where_it_can = false) {
  const auto shade = [](double x) { return 0.2 + x / width; };
  const Plate plate = plate_of([&](int x, int) { return glm::dvec3(1, 0.5, 0.25) * shade(x); });
  for (const auto estimator : both_estimators) {
    const Rendered result = render_over(view, plate, by_camera(estimator), 16);
    EXPECT_GT(result.counters.measured, 0u);
    int compared = 0;
    for (const auto& [x, y, i] : pixels_of(width, height)) {
      const glm::dvec2 seen = mirrored_pixel(view, x, y);
      if (!is_inside(seen) || result.layers.mask[i] != 1) continue;
      // Samples are spread over the pixel: its image is less than three pixels wide, of whose
      // slope of 1/width the 16 stratified samples' mean is off by less than a quarter.
      const double off = result.layers.composite[i].g - 0.5 * shade(seen.x);
      const double allowed = 0.25 * 3 * 0.5 / width;
      if (where_it_can && off < -allowed) continue;
      EXPECT_NEAR(off, 0, allowed);
      ++compared;
    }
    EXPECT_GT(compared, 20) << "the mirror must show the floor";
  }
}

TEST(CameraRadiance, AMirrorShowsThePlate) {
  expect_mirror_shows_plate(floor_and_mirror());
}

// Without its divisor the lens would draw the corners, 0.6 off the axis, two pixels further out.
TEST(CameraRadiance, AMirrorShowsThePlateThroughARationalLens) {
  View view = floor_and_mirror();
  PinholeIntrinsics& lens = view.calibration.intrinsics;
  lens.k1 = 0.05, lens.k4 = 0.25, lens.k5 = -0.05, lens.k6 = 0.02;
  expect_mirror_shows_plate(view);
}

// Paint and plastic as glTF's defaults have them, and as Blender writes them: the rough coat
// reflects a few per cent, but more than a tenth where the floor is seen at less than 28 degrees.
TEST(CameraRadiance, AMirrorShowsThePlateOfAPaintedFloor) {
  for (const float roughness : {0.5f, 1.0f}) {
    View view = floor_and_mirror();
    view.scene.materials[0] = plastic(glm::vec3(albedo), roughness);
    expect_mirror_shows_plate(view, true);
  }
}

// What the camera sees in the coat of a painted floor is not what the mirror sees in it. Both are
// at most a tenth of what arrives there, here 1 from everywhere but the floor itself.
TEST(CameraRadiance, OfAPaintedFloorIsWrongByNoMoreThanItsCoat) {
  View view = floor_and_mirror();
  view.scene.materials[0] = plastic(glm::vec3(albedo), 0.5f);
  view.environment = uniform_environment(glm::vec3(1));
  View real = view;
  real.scene.instances.pop_back();
  const render::Layers seen = render_clean(real, 256).layers;
  const Plate plate = linear_plate(width, height, seen.real, white);
  const set::Estimation traced = up_to_depth(8);
  const render::Layers by_plate = render_over(view, plate, by_camera(), 64).layers;
  const render::Layers by_model = render_over(view, plate, traced, 64).layers;
  render::Layers shown;
  double expected = 0;
  for (const std::size_t i : mirrored_pixels(view, by_plate)) {
    shown.mixed.push_back(by_plate.mixed[i] - by_model.mixed[i]);
    expected += static_cast<double>(by_model.mixed[i].g);
  }
  ASSERT_GT(shown.mixed.size(), 20u);
  EXPECT_LT(std::abs(mean(shown.mixed).g), 0.1 + 4 * standard_error_of_pixels(shown));
  EXPECT_GT(expected / static_cast<double>(shown.mixed.size()), 0.3);
}

// In the sun, the mirror shows the plate's floor and on it the shadow of a virtual ball, darker
// than the plate by what the model says the sun brings.
TEST(CameraRadiance, AMirrorShowsThePlateWithVirtualShadows) {
  View view = floor_and_mirror();
  const set::Light sun = sun_lamp(glm::normalize(glm::dvec3(0, 0.5, -1)), 0, glm::dvec3(3));
  view.scene.lights.push_back(sun);
  // A roof far above that shades all that the mirror shows.
  add(view.scene, rectangle_mesh({60, 60}), emitter(glm::vec3(0)), at({0, -40, 80}),
      scene::world_mixed);
  const double brought = albedo / std::numbers::pi * 3 * -sun.direction.z;
  const Plate plate = plate_of([](int, int) { return glm::dvec3(2); });
  set::Estimation estimation = by_camera();
  estimation.max_depth = 2;  // mirror, floor: not what the mirror adds to the floor
  const Rendered result = render_over(view, plate, estimation, 16);
  render::Layers shown;  // the pixels that show the floor in the mirror; all expect the same
  for (const std::size_t i : mirrored_pixels(view, result.layers))
    shown.mixed.push_back(result.layers.composite[i]);
  ASSERT_GT(shown.mixed.size(), 20u);
  EXPECT_NEAR(mean(shown.mixed).g, 2 - brought, 0.51 * white / 65535);  // half a code, and rounding
  EXPECT_EQ(standard_error_of_pixels(shown), 0);  // no difference is left to chance
}

// Where the plate is clipped, or the floor not matt, the model's own radiance is traced: here none.
TEST(CameraRadiance, WhatCannotBeMeasuredIsTracedAndCounted) {
  const auto expect_traced = [](const View& view, const Plate& plate) {
    const Rendered result = render_over(view, plate, by_camera());
    EXPECT_EQ(result.counters.measured, 0u);
    EXPECT_GT(result.counters.unmeasured, 0u);
    EXPECT_EQ(mean(result.layers.mixed), glm::dvec3(0));
  };
  const Plate gray = plate_of([](int, int) { return glm::dvec3(1); });
  View view = floor_and_mirror();
  expect_traced(view, plate_of([](int, int) { return glm::dvec3(1, white, 1); }));
  const scene::Material paint = plastic(glm::vec3(albedo), 0.5f);
  scene::Material lacquered = paint, cloth = diffuse(glm::vec3(albedo)), glossy = paint;
  lacquered.clearcoat = 1;              // it mirrors what is above the floor
  cloth.sheen_color = glm::vec3(0.5f);  // it shines where seen from the side
  glossy.specular_color = glm::vec3(4);
  scene::Material black = emitter(glm::vec3(0));
  black.specular = 1;
  black.roughness = 0.3f;
  for (const scene::Material& floor :
       {plastic(glm::vec3(albedo), 0.3f), lacquered, cloth, glossy, black}) {
    SCOPED_TRACE(floor.name);
    view.scene.materials[0] = floor;
    expect_traced(view, gray);
  }
}

// A wall before the floor hides what the mirror shows of it.
TEST(CameraRadiance, WhatIsHiddenIsTraced) {
  View view = floor_and_mirror();
  glm::dmat4 pose(1);
  pose[1] = {0, 0, 1, 0};
  pose[2] = {0, -1, 0, 0};
  pose[3] = {0, -1.2, 0, 1};
  // The mixed rays pass it.
  add(view.scene, rectangle_mesh({4, 2.6}), 0u, pose, scene::world_real);
  const Plate plate = plate_of([](int, int) { return glm::dvec3(1); });
  const Rendered result = render_over(view, plate, by_camera());
  for (const std::size_t i : mirrored_pixels(view, result.layers))
    EXPECT_EQ(result.layers.mixed[i], glm::vec3(0)) << i;
}

TEST(CameraRadiance, WithNothingVirtualThePlateIsUntouched) {
  View view = floor_and_mirror();
  view.scene.instances.pop_back();
  view.environment = uniform_environment(glm::vec3(1));
  const Plate plate =
      plate_of([](int x, int y) { return glm::dvec3(0.1 + 0.01 * x, 1, 0.02 * y); });
  for (const auto estimator : both_estimators) {
    SetRenderer renderer(view, by_camera(estimator));
    renderer.begin({std::make_shared<const Plate>(plate), 1 / white, view.world_from_camera, 1});
    renderer.render(4);
    EXPECT_EQ(renderer.show(false).samples, plate.samples);
    expect_clean(renderer.counters());
  }
}

// A path that forks at the camera ray's first hit and again where it has landed on the floor is two
// rounds behind the one that it started as: a removed board hides a virtual ball, which mirrors the
// floor that the camera sees. What a batch left in the queue would be added to other samples of the
// next one.
TEST(CameraRadiance, APathThatForksTwiceEndsWithItsBatch) {
  View view = empty_view({0, -2, 1.2}, {0, 0, 0}, pinhole(width, height, 0.9), glm::vec3(1));
  add(view.scene, rectangle_mesh({8, 8}), diffuse(glm::vec3(albedo)));
  // A metre before the camera, over the upper half of its view.
  glm::dmat4 before = view.world_from_camera;
  before[3] += before[2] - 1.45 * before[1];
  add(view.scene, rectangle_mesh({3, 3}), 0u, before, scene::world_real);
  add(view.scene, icosphere_mesh(0.4, 3), metal(glm::vec3(0.9f), 0), at({0, 0, 0.5}),
      scene::world_mixed);
  view.calibration.response.kind = ResponseCurve::Kind::linear;
  set::Estimation estimation = by_camera(set::Estimator::difference);
  estimation.max_depth = 2;
  const auto plate =
      std::make_shared<const Plate>(plate_of([](int, int) { return glm::dvec3(1); }));
  SetRenderer renderer(view, estimation);
  const auto layers_by = [&](std::initializer_list<int> parts) {
    renderer.begin({plate, 1 / white, view.world_from_camera, 1});
    for (const int samples : parts) renderer.render(samples);
    expect_clean(renderer.counters());
    return renderer.layers();
  };
  const render::Layers whole = layers_by({7}), split = layers_by({1, 4, 2});
  EXPECT_EQ(whole.mixed, split.mixed);
  EXPECT_EQ(whole.diff, split.diff);
}

// Without a plate there is nothing to take: the pictures are those that are traced, bit for bit.
TEST(CameraRadiance, WithoutAPlateAllIsTraced) {
  View view = floor_and_mirror();
  view.environment = uniform_environment(glm::vec3(1));
  const set::Estimation traced = up_to_depth(8);
  EXPECT_EQ(render_view(view, 4, by_camera()).layers.mixed,
            render_view(view, 4, traced).layers.mixed);
}

// The camera saw a paper on the floor, which is hidden. What the mirror shows there is the floor,
// although that is only a tenth of a millimetre behind the paper.
TEST(CameraRadiance, IsNotThatOfWhatIsRemovedCloseByWhatIsMet) {
  View view = floor_and_mirror();
  const scene::Scene without = view.scene;
  add(view.scene, rectangle_mesh({7, 7}), diffuse(glm::vec3(albedo)), at({0, 0, 1e-4}),
      scene::world_real);
  const Plate bright = plate_of([](int, int) { return glm::dvec3(0.9 * white); });
  const auto brightest = [&] {
    const render::Layers layers = render_over(view, bright, by_camera()).layers;
    float most = 0;
    for (const Pixel& pixel : pixels_of(width, height))
      if (layers.mask[pixel.i] == 1 && layers.depth[pixel.i] > 0)
        most = std::max(most, layers.mixed[pixel.i].g);
    return most;
  };
  EXPECT_LT(brightest(), 2) << "the sky has 1, and the plate 3.6";
  view.scene = without;
  EXPECT_GT(brightest(), 3) << "that is what is seen where the camera's measurement is used";
}

}  // namespace previz::test::camera_test
