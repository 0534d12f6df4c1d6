// Pixels that are partly covered or defocused (P18): where the plate is the renderer's own
// converged real world, the composite must be its mixed world, on every pixel.
#include "tests/support/render_fixture.hpp"

namespace previz::test::edge_test {

constexpr int width = 40, height = 30, scrambles = 16;
// The sensor's white; its response is linear with 16 bits, so rounding leaves 1e-5 of it.
constexpr double white = 4;

struct Picture {
  std::vector<glm::dvec3> mean, error;  // over scrambles, and its standard error
};

// Means of the layer that `pick` takes, over independent scrambles.
template <typename Pick>
Picture converge(const View& view, const Plate& plate, set::Estimator estimator, std::uint32_t seed,
                 Pick pick) {
  SetRenderer renderer(view, up_to_depth(3, estimator));
  Picture result;
  std::vector<std::vector<glm::dvec3>> values(width * height);  // by pixel
  for (int i = 0; i < scrambles; ++i) {
    renderer.begin(
        {std::make_shared<const Plate>(plate), 1 / white, view.world_from_camera, seed + i});
    renderer.render(32);
    expect_clean(renderer.counters());
    const auto layer = pick(renderer.layers());
    for (std::size_t p = 0; p < layer.size(); ++p) values[p].emplace_back(layer[p]);
  }
  for (const std::vector<glm::dvec3>& of_pixel : values) {
    const auto [mean, error] = estimate_of(of_pixel);
    result.mean.push_back(mean);
    result.error.push_back(error);
  }
  return result;
}

// A black and white floor of stripes as wide as two pixels, so that edges cross the object's; a
// virtual box on it, and a real one that is taken away.
View striped_set() {
  View view =
      empty_view({0.1, -0.9, 0.8}, {0, 0, 0.05}, pinhole(width, height, 0.8), {1, 1.1f, 1.2f});
  const auto stripe = add_mesh(view.scene, rectangle_mesh({0.05, 2}));
  const auto black = add_material(view.scene, diffuse(glm::vec3(0.02f)));
  const auto bright = add_material(view.scene, diffuse(glm::vec3(0.9f)));
  for (int i = -20; i < 20; ++i) {
    add_instance(view.scene, stripe, i % 2 == 0 ? black : bright, at({0.05 * i, 0, 0}));
  }
  const auto box = add_mesh(view.scene, box_mesh({0.2, 0.2, 0.2}));
  const auto red = add_material(view.scene, diffuse({0.7f, 0.2f, 0.1f}));
  add_instance(view.scene, box, red, at({-0.213, 0.05, 0.1}), scene::world_mixed);
  add_instance(view.scene, box, red, at({0.227, -0.03, 0.1}), scene::world_real);
  view.calibration.response.kind = ResponseCurve::Kind::linear;
  return view;
}

void expect_seamless(const View& view, set::Estimator estimator) {
  const auto real = [](const render::Layers& layers) { return layers.real; };
  const auto mixed = [](const render::Layers& layers) { return layers.mixed; };
  const auto composite = [](const render::Layers& layers) { return layers.composite; };
  const Picture plate_picture = converge(view, {}, set::Estimator::paired, 100, real);
  const Picture truth = converge(view, {}, set::Estimator::paired, 200, mixed);
  const Picture composited = converge(view, linear_plate(width, height, plate_picture.mean, white),
                                      estimator, 300, composite);
  int beyond = 0;
  double sum = 0, square = 0;
  for (std::size_t p = 0; p < truth.mean.size(); ++p) {
    const double rounding = white / 65535;
    const double error =
        std::sqrt(std::pow(composited.error[p].g, 2) + std::pow(truth.error[p].g, 2) +
                  std::pow(plate_picture.error[p].g, 2) + rounding * rounding);
    const double difference = composited.mean[p].g - truth.mean[p].g;
    beyond += std::abs(difference) > 5 * error;
    sum += difference;
    square += error * error;
  }
  // Student's t with 15 degrees of freedom is beyond 5 with probability 1.6e-4: 0.2 of 1200 pixels.
  EXPECT_LE(beyond, 3);
  EXPECT_LT(std::abs(sum), 4 * std::sqrt(square));
}

TEST(Edges, AreSeamlessInFocus) {
  for (const auto estimator : both_estimators) expect_seamless(striped_set(), estimator);
}

TEST(Edges, AreSeamlessOutOfFocus) {
  View view = striped_set();
  view.calibration.lens = ThinLens{0.05, 0.8, 0.7};  // objects are 0.4 m behind the focus
  for (const auto estimator : both_estimators) expect_seamless(view, estimator);
}

}  // namespace previz::test::edge_test
