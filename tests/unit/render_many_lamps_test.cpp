// A thousand lamps of which few reach a point: what their light samples find, and how noisily.
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/support/render_fixture.hpp"

namespace previz::test {
namespace render_many_lamps_test {

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

// As many as bright lamps far away: points, spots and panels that face the other way, and panels
// below the floor.
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

// Statistics of single samples, over the pixels, which see one point, and over seeds. The error of
// the mean is that of independent pixels, an over-estimate.
Noise noise_of(const std::vector<set::Light>& lamps, const set::Estimation& estimation,
               int seeds = 24, const scene::Mesh* board = nullptr) {
  View view = lit_point(albedo);
  view.scene.lights = lamps;
  if (board)
    add_instance(view.scene, add_mesh(view.scene, *board),
                 add_material(view.scene, diffuse(glm::vec3(0))),
                 glm::translate(glm::dmat4(1), glm::dvec3(0, 0.3, 0.7)));
  SetRenderer renderer(view, estimation);
  std::vector<double> samples;
  for (int seed = 0; seed < seeds; ++seed) {
    renderer.begin({{}, 1.0, view.world_from_camera, static_cast<std::uint32_t>(seed)});
    renderer.render(1);
    for (const glm::vec3& pixel : renderer.layers().mixed) samples.push_back(pixel.g);
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
  const Noise alone = noise_of(few, up_to_depth(1)), among = noise_of(all, up_to_depth(1));
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
  const scene::Mesh board = rectangle_mesh({0.3, 0.3});
  const std::vector<set::Light> far = far_lamps(995);
  const Noise alone = noise_of(few, up_to_depth(1), 24, &board);
  const Noise among = noise_of(both(few, far), up_to_depth(1), 24, &board);
  // The far lamps are low, so that the board stands in the way of none.
  EXPECT_NEAR(among.mean, alone.mean + closed_form(far), 4 * std::hypot(alone.error, among.error));
  const double accuracy = std::hypot(alone.accuracy, among.accuracy);
  EXPECT_LT(accuracy, 0.05);
  EXPECT_LE(among.deviation / alone.deviation, 3 * (1 - 2 * accuracy))
      << among.deviation << " of all, " << alone.deviation << " of five";
  RecordProperty("deviation_of_all", std::to_string(among.deviation));
  RecordProperty("deviation_of_five", std::to_string(alone.deviation));
}

}  // namespace render_many_lamps_test
}  // namespace previz::test
