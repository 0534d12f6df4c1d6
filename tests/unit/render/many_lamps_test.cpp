// A thousand lamps of which few reach a point: what their light samples find, and how noisily.
#include <glm/ext/matrix_transform.hpp>

#include "daemon/core/render/world/emission_weights.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::many_lamps_test {

constexpr double pi = std::numbers::pi;
constexpr double albedo = 0.6;

// Five lamps of intensity 1 within reach of the point, of which one is a spot.
std::vector<set::Light> near_lamps() {
  std::vector<set::Light> lamps;
  for (int i = 0; i < 5; ++i) {
    const double turn = 1.3 * i;
    set::Light light = lamp(i == 0 ? set::LightType::spot : set::LightType::point);
    light.position = {(0.4 + 0.1 * i) * std::cos(turn), (0.4 + 0.1 * i) * std::sin(turn),
                      0.9 + 0.15 * i};
    light.direction = -glm::normalize(light.position);
    light.inner_cone_rad = 0.5;
    light.outer_cone_rad = 0.7;
    lamps.push_back(light);
  }
  return lamps;
}

// Returns lamps that are as bright and far away: points, spots and panels that face the other way,
// and panels below the floor.
std::vector<set::Light> far_lamps(int count) {
  std::vector<set::Light> lamps;
  for (int i = 0; i < count; ++i) {
    const double turn = 2.399963 * i;  // the golden angle
    const double distance = 12 + 0.02 * i;
    const glm::dvec3 aside(std::cos(turn), std::sin(turn), 0);
    set::Light light = lamp(i % 4 == 0   ? set::LightType::point
                            : i % 4 == 1 ? set::LightType::spot
                                         : set::LightType::rectangle);
    const bool is_turned = i % 4 != 0 && i % 4 != 3;
    light.position = (is_turned ? 0.25 : 1.0) * distance * aside;
    light.position.z = i % 4 == 3 ? -2 - 0.003 * i : 2 + 0.003 * i;
    light.direction = is_turned ? glm::normalize(aside + glm::dvec3(0, 0, 1)) : glm::dvec3(0, 0, 1);
    light.inner_cone_rad = 0.2;
    light.outer_cone_rad = 0.8;
    light.up = {aside.y, -aside.x, 0};
    light.width_m = light.height_m = 1;
    lamps.push_back(light);
  }
  return lamps;
}

// The radiance of the point by the points and by the spots within whose inner cone it lies; the
// others do not reach it.
double closed_form(const std::vector<set::Light>& lamps) {
  double sum = 0;
  for (const set::Light& light : lamps) {
    const glm::dvec3 to_lamp = glm::normalize(light.position);
    const bool shines =
        light.type == set::LightType::point ||
        (light.type == set::LightType::spot && glm::dot(-to_lamp, light.direction) > std::cos(0.5));
    if (shines) sum += light.emission.g * to_lamp.z / glm::dot(light.position, light.position);
  }
  return albedo / pi * sum;
}

struct Noise {
  double mean = 0, error = 0;  // of the mean
  double deviation = 0;        // of a sample, over the mean
  double accuracy = 0;         // relative standard error of the deviation
};

using Layer = render::Sheet<glm::vec3> render::Layers::*;

// Statistics of single samples, over the pixels, which see one point, and over seeds. The error of
// the mean is that of independent pixels, an over-estimate.
Noise noise_of(const View& view, const set::Estimation& estimation, int seeds = 24,
               Layer layer = &render::Layers::mixed) {
  SetRenderer renderer(view, estimation);
  std::vector<double> samples;
  for (int seed = 0; seed < seeds; ++seed) {
    const render::Layers layers = renderer.rendered(1, static_cast<std::uint32_t>(seed));
    for (const glm::vec3& pixel : layers.*layer) samples.push_back(pixel.g);
  }
  expect_clean(renderer.counters());
  const auto n = static_cast<double>(samples.size());
  Noise noise;
  for (const double sample : samples) noise.mean += sample / n;
  double second = 0, fourth = 0;
  for (const double sample : samples) {
    const double square = (sample - noise.mean) * (sample - noise.mean);
    second += square / n;
    fourth += square * square / n;
  }
  noise.error = std::sqrt(second / n);
  noise.deviation = std::sqrt(second) / noise.mean;
  // The variance of a variance is (m4 - m2^2) / n, and a deviation's relative error is half its.
  noise.accuracy = second > 0 ? 0.5 * std::sqrt((fourth / (second * second) - 1) / n) : 0;
  return noise;
}

View lit_by(const std::vector<set::Light>& lamps) {
  View view = lit_point(albedo);
  view.scene.lights = lamps;
  return view;
}

std::vector<set::Light> both(std::vector<set::Light> lamps, const std::vector<set::Light>& more) {
  lamps.insert(lamps.end(), more.begin(), more.end());
  return lamps;
}

// The deviation of choosing among lamps of equal power by power, n sum(f^2) / sum(f)^2 - 1 squared,
// where nothing else is left to chance.
double deviation_by_power(const std::vector<set::Light>& lamps) {
  double sum = 0, squares = 0;
  for (const set::Light& light : lamps) {
    const double f = closed_form({light});
    sum += f;
    squares += f * f;
  }
  return std::sqrt(static_cast<double>(lamps.size()) * squares / (sum * sum) - 1);
}

TEST(ManyLamps, OfWhichFiveReachAPointAreAtMostThreeTimesAsNoisyAsThese) {
  const std::vector<set::Light> few = near_lamps(), all = both(few, far_lamps(995));
  const Noise alone = noise_of(lit_by(few), up_to_depth(1));
  const Noise among = noise_of(lit_by(all), up_to_depth(1));
  EXPECT_NEAR(alone.mean, closed_form(few), 4 * alone.error + 1e-3 * alone.mean);
  EXPECT_NEAR(among.mean, closed_form(all), 4 * among.error + 1e-3 * among.mean);
  EXPECT_LT(among.accuracy, 0.05);
  EXPECT_LT(alone.deviation, deviation_by_power(few));
  EXPECT_LE(among.deviation, 3 * (1 - 2 * among.accuracy) * deviation_by_power(few));
  RecordProperty("deviation_of_all", std::to_string(among.deviation));
  RecordProperty("deviation_of_five", std::to_string(alone.deviation));
}

// Five panels, each of which a board hides in part: here the noise of a lamp by itself counts, too.
TEST(ManyLamps, OfWhichFivePanelsReachAPointInTheirPenumbras) {
  std::vector<set::Light> few = near_lamps();
  for (set::Light& light : few) {
    light.type = set::LightType::rectangle;
    light.up = {light.direction.y, -light.direction.x, 0};
    light.width_m = light.height_m = 0.6;
  }
  const std::vector<set::Light> far = far_lamps(995);
  const auto under_a_board = [](View view) {
    add(view.scene, rectangle_mesh({0.3, 0.3}), diffuse(glm::vec3(0)), at({0, 0.3, 0.7}));
    return view;
  };
  const Noise alone = noise_of(under_a_board(lit_by(few)), up_to_depth(1));
  const Noise among = noise_of(under_a_board(lit_by(both(few, far))), up_to_depth(1));
  // The far lamps are low, so that the board stands in the way of none.
  EXPECT_NEAR(among.mean, alone.mean + closed_form(far), 4 * std::hypot(alone.error, among.error));
  const double accuracy = std::hypot(alone.accuracy, among.accuracy);
  EXPECT_LT(accuracy, 0.05);
  EXPECT_LE(among.deviation / alone.deviation, 3 * (1 - 2 * accuracy))
      << among.deviation << " of all, " << alone.deviation << " of five";
  RecordProperty("deviation_of_all", std::to_string(among.deviation));
  RecordProperty("deviation_of_five", std::to_string(alone.deviation));
}

// Lamps in one place, black lamps, a lamp that lies in the surface, and lamps that shine in one
// world or differently in both.
TEST(ManyLamps, MayCoincideBeBlackOrDiffer) {
  std::vector<set::Light> lamps;
  double mixed = 0, diff = 0;
  for (int i = 0; i < 36; ++i) {
    set::Light light = lamp(i % 9 == 8 ? set::LightType::spot : set::LightType::point);
    light.position = i < 18 ? glm::dvec3(0.3, 0.2, 1) : glm::dvec3(0.1 * i - 3, 0.7, 1.5);
    light.direction = -glm::normalize(light.position);
    light.inner_cone_rad = 0.5;
    light.outer_cone_rad = 0.5;
    light.gain_mixed = i % 3 == 1 ? 0 : 0.5 + 0.1 * (i % 4);
    light.gain_real = i % 3 == 2 ? 0 : 1;
    if (i % 6 == 5) light.emission = glm::dvec3(0);
    mixed += light.gain_mixed * closed_form({light});
    diff += (light.gain_mixed - light.gain_real) * closed_form({light});
    lamps.push_back(light);
  }
  lamps.push_back(point_lamp({0.5, 0, 0}));  // in the surface
  const Noise of_mixed = noise_of(lit_by(lamps), up_to_depth(1));
  const Noise of_diff = noise_of(lit_by(lamps), up_to_depth(1), 24, &render::Layers::diff);
  EXPECT_NEAR(of_mixed.mean, mixed, 4 * of_mixed.error + 1e-3 * mixed);
  EXPECT_NEAR(of_diff.mean, diff, 4 * of_diff.error + 1e-3 * std::abs(diff));
}

// A scene a thousand times as large or as small, or a kilometre away, with lamps that are brighter
// by the square of its size: the same light, and as noisy. The deviation may differ by its own
// error and by that of a choice among lamps whose places are rounded to 6e-5 m, a kilometre away.
TEST(ManyLamps, AreChosenAlikeAtAnySizeAndPlace) {
  const std::vector<set::Light> lamps = both(near_lamps(), far_lamps(60));
  const Noise here = noise_of(lit_by(lamps), up_to_depth(1), 8);
  const auto placed = [&](double size, const glm::dvec3& where) {
    View view = lit_by(lamps);
    for (set::Light& light : view.scene.lights) {
      light.position = where + size * light.position;
      light.width_m *= size;
      light.height_m *= size;
      if (light.type != set::LightType::rectangle) light.emission *= size * size;
    }
    const glm::dmat4 place = glm::scale(at(where), glm::dvec3(size));
    for (scene::Instance& instance : view.scene.instances)
      instance.world_from_object = place * instance.world_from_object;
    view.world_from_camera[3] = place * view.world_from_camera[3];
    const Noise noise = noise_of(view, up_to_depth(1), 8);
    EXPECT_NEAR(noise.mean, here.mean, 4 * std::hypot(noise.error, here.error) + 1e-3 * here.mean);
    EXPECT_NEAR(noise.deviation / here.deviation, 1,
                4 * std::hypot(noise.accuracy, here.accuracy) + 0.01);
  };
  placed(1e-3, glm::dvec3(0));
  placed(1e3, glm::dvec3(0));
  placed(1, glm::dvec3(1000, -300, 20));
}

// Inside a ball of 1280 triangles that shine with 1 and reflect a half, radiance is 1 + 1/2 + 1/4
// of paths of two bounces, whatever their directions: what light samples and paths that meet a
// triangle bring is weighed by the same choice of a lamp.
TEST(ManyLamps, BringTheSameByLightSamplesAndByChance) {
  scene::Material wall = diffuse(glm::vec3(0.5f));
  wall.emission = glm::vec3(1);
  View view = empty_view({0.5, 0, 0.2}, {-1, 0.3, 0}, pinhole(48, 48, 1.2));
  view.scene = furnace_sphere(1, 3, wall);
  for (int depth = 0; depth < 3; ++depth) {
    SCOPED_TRACE(depth);
    const Rendered result = render_clean(view, 16, up_to_depth(depth));
    EXPECT_NEAR(mean(result.layers.mixed).g, 2 - std::exp2(-depth),
                4 * standard_error_of_pixels(result.layers) + 1e-4);
  }
}

// A wall of 32 x 32 screens, two triangles each, of which one glows; the others are black.
scene::Mesh wall_mesh(int side) {
  scene::Mesh mesh;
  const auto at = [&](int i) {
    return 2.0f * static_cast<float>(i) / static_cast<float>(side) - 1;
  };
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      mesh.positions.emplace_back(at(i), at(j), 0);
      mesh.normals.emplace_back(0, 0, 1);
      mesh.uvs.emplace_back((at(i) + 1) / 2, (at(j) + 1) / 2);
    }
  const auto vertex = [&](int i, int j) { return static_cast<std::uint32_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      mesh.triangles.emplace_back(vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1));
      mesh.triangles.emplace_back(vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1));
    }
  return mesh;
}

scene::Texture one_lit_texel(int side, int column, int row) {
  scene::Texture texture = texture_of(side, side);
  texture.nearest = true;
  texture.texels.assign(static_cast<std::size_t>(side) * side, glm::vec4(0, 0, 0, 1));
  texture.texels[static_cast<std::size_t>(row * side + column)] = glm::vec4(1);
  return texture;
}

// If all screens were equal, one sample in 1024 would bring light, for a deviation of 32. The black
// ones together count as a tenth of the lit one and, where they are nearer to the point, up to 2.5
// times as much: the lit one gets three quarters of the samples or more, for sqrt(1 / 0.75 - 1).
TEST(ManyLamps, OfAWallOfScreensAreChosenByTheirPicture) {
  constexpr int side = 32;
  View view = lit_point(albedo);
  scene::Material material = emitter(glm::vec3(100));
  material.emission_texture = add_texture(view.scene, one_lit_texel(side, 20, 9));
  add(view.scene, wall_mesh(side), material, at({0, 0, 1}));
  const Noise noise = noise_of(view, up_to_depth(1));
  const glm::dvec3 screen(20.5 * 2 / side - 1, 9.5 * 2 / side - 1, 1);
  const double squared = glm::dot(screen, screen), area = 4.0 / (side * side);
  // Cosines and distance over so small a screen are those of its centre to (0.06)^2.
  EXPECT_NEAR(noise.mean, albedo / pi * 100 * area / (squared * squared),
              4 * noise.error + 4e-3 * noise.mean);
  EXPECT_LT(noise.deviation, 0.58);
}

TEST(ManyLamps, WeighATriangleByTheMeanOfItsTexture) {
  scene::Scene scene;
  scene::Texture texture = texture_of(8, 1);
  for (int i = 0; i < 8; ++i) texture.texels.emplace_back(glm::vec3(i < 4 ? 1 : 0), 1);
  scene::Material material = emitter(glm::vec3(3, 2, 1));
  material.emission_texture = add_texture(scene, texture);
  add(scene, wall_mesh(1), material);
  // Of the triangle below the diagonal a quarter lies left of the middle.
  EXPECT_THAT(
      render::emission_weights(scene, scene.instances[0]),
      ::testing::ElementsAre(::testing::DoubleNear(0.25, 1e-6), ::testing::DoubleNear(0.75, 1e-6)));
  scene.materials[0].emission_texture = scene::no_texture;
  EXPECT_TRUE(render::emission_weights(scene, scene.instances[0]).empty());
  scene.materials[0].alpha_mode = scene::AlphaMode::blend;
  scene.materials[0].alpha = 0.5f;
  EXPECT_THAT(render::emission_weights(scene, scene.instances[0]), ::testing::Each(0.5));
}

TEST(ManyLamps, AreEncodedAnewOnlyWhenOneOfThemHasChanged) {
  View view = lit_point(albedo);
  view.scene.lights = near_lamps();
  const glm::dmat4 above = at({0, 0, 3});
  const std::uint32_t panel = add(view.scene, rectangle_mesh({1, 1}), emitter(glm::vec3(1)), above);
  const std::uint32_t box =
      add(view.scene, box_mesh(glm::dvec3(0.1)), diffuse(glm::vec3(1)), above);
  SetRenderer renderer(view, up_to_depth(1));
  const auto encoded = [&](double along) {
    glm::dmat4 camera = view.world_from_camera;
    camera[3].x += along;
    renderer.begin({{}, 1.0, camera});
    return renderer.counters().encoded_lights;
  };
  EXPECT_EQ(encoded(0), 1u);
  EXPECT_EQ(encoded(0), 1u) << "nothing has changed";
  EXPECT_EQ(encoded(0.1), 1u) << "the camera has moved";
  view.scene.instances[box].world_from_object[3].z = 2;
  renderer.move(view.scene.instances, view.scene.lights);
  EXPECT_EQ(encoded(0.1), 1u) << "a box has moved";
  view.scene.lights[2].gain_mixed = 0.5;
  renderer.move(view.scene.instances, view.scene.lights);
  EXPECT_EQ(encoded(0.1), 2u) << "a lamp was dimmed";
  view.scene.instances[panel].world_from_object[3].x = 1;
  renderer.move(view.scene.instances, view.scene.lights);
  EXPECT_EQ(encoded(0.1), 3u) << "a panel has moved";
  EXPECT_EQ(encoded(0.2), 3u);

  // What was kept gives the same picture, bit for bit, as what is encoded for this camera.
  renderer.render(4);
  const auto kept = renderer.layers().mixed;
  SetRenderer fresh(view, up_to_depth(1));
  glm::dmat4 camera = view.world_from_camera;
  camera[3].x += 0.2;
  fresh.begin({{}, 1.0, camera});
  fresh.render(4);
  EXPECT_EQ(fresh.layers().mixed, kept);
}

// A sun and the sky count through a disc as wide as what is lit, in half octaves, here the virtual
// object and a lamp 2 m away. So the lights stay as they are while the object moves a little, and
// are weighed anew when it has gone far.
TEST(ManyLamps, AreNotEncodedAnewForEachMotionOfAVirtualObject) {
  View view = lit_point(albedo, 20);
  view.scene.lights = {point_lamp({2, 0, 1}), lamp(set::LightType::directional)};
  const std::uint32_t box = add(view.scene, box_mesh(glm::dvec3(0.1)), diffuse(glm::vec3(1)),
                                at({0, 0, 1}), scene::world_mixed);
  SetRenderer renderer(view, up_to_depth(1));
  const auto encoded = [&](double along) {
    view.scene.instances[box].world_from_object[3].x = along;
    renderer.move(view.scene.instances, view.scene.lights);
    renderer.begin({{}, 1.0, view.world_from_camera});
    return renderer.counters().encoded_lights;
  };
  // The radius goes from 1.03 m to 0.88 m; all from 0.74 m to 1.05 m is a sixteenth of the scene's.
  for (int i = 5; i < 35; ++i) EXPECT_EQ(encoded(0.01 * i), 1u) << 0.01 * i;
  EXPECT_EQ(encoded(-4), 2u) << "3 m";
}

// 60 spheres and panels, partly behind each other, and a sun.
std::vector<set::Light> lamps_in_view() {
  std::vector<set::Light> lamps;
  for (int i = 0; i < 60; ++i) {
    set::Light light = lamp(i % 2 == 0 ? set::LightType::sphere : set::LightType::rectangle,
                            glm::dvec3(1 + 0.1 * i));
    const int row = i / 10;
    light.position = {0.4 * (i % 10) - 1.8, 2 + 0.3 * (i % 7), 0.5 * row - 1.2};
    light.radius_m = 0.15;
    light.direction = {0, -1, 0.1};
    light.up = {0, 0, 1};
    light.width_m = 0.5;
    light.height_m = 0.2;
    lamps.push_back(light);
  }
  lamps.insert(lamps.begin() + 30, sun_lamp({0, -1, -0.2}, 0.1));
  return lamps;
}

// What the camera sees of all lamps is the sum of what it sees of each four, which no tree chooses
// from, because lamps block nothing. The sums of 16 floats may round.
void expect_seen_as_each_by_itself(const std::vector<set::Light>& lamps, set::Estimator estimator,
                                   const auto& layer) {
  const auto seen = [&](std::size_t first, std::size_t count) {
    View view = empty_view({0, -1, 0}, {0, 2, 0}, pinhole(96, 64, 1.4));
    add(view.scene, rectangle_mesh({0.1, 0.1}), diffuse(glm::vec3(0)));
    for (std::size_t i = first; i < std::min(first + count, lamps.size()); ++i)
      view.scene.lights.push_back(lamps[i]);
    const render::Layers layers = render_clean(view, 4, up_to_depth(0, estimator)).layers;
    return std::vector<glm::vec3>(layer(layers).begin(), layer(layers).end());
  };
  const auto all = seen(0, lamps.size());
  std::vector<glm::vec3> sum(all.size(), glm::vec3(0)), sizes = sum;
  for (std::size_t first = 0; first < lamps.size(); first += 4) {
    const auto four = seen(first, 4);
    for (std::size_t i = 0; i < sum.size(); ++i) {
      sum[i] += four[i];
      sizes[i] += glm::abs(four[i]);
    }
  }
  double most = 0;
  for (std::size_t i = 0; i < sum.size(); ++i) {
    EXPECT_NEAR(all[i].g, sum[i].g, 16 * 6e-8 * sizes[i].g) << "pixel " << i;
    most = std::max(most, 1.0 * sizes[i].g);
  }
  EXPECT_GT(most, 5);
}

TEST(ManyLamps, AreSeenAsEachByItself) {
  expect_seen_as_each_by_itself(
      lamps_in_view(), set::Estimator::paired,
      [](const auto& layers) -> auto& { return layers.mixed; });
}

// Of the difference only those are met that do not shine alike in both worlds.
TEST(ManyLamps, ThatDifferAreSeenAmongThoseThatDoNot) {
  std::vector<set::Light> lamps = lamps_in_view();
  for (std::size_t i = 0; i < lamps.size(); i += 3) lamps[i].gain_real = i % 2 == 0 ? 0 : 2.5;
  expect_seen_as_each_by_itself(
      lamps, set::Estimator::difference, [](const auto& layers) -> auto& { return layers.diff; });
}

}  // namespace previz::test::many_lamps_test
