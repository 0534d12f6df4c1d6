// How bright the model comes out beside the picture: what counts, and what is said of it.
#include "daemon/core/pipeline/light_figure.hpp"

#include "daemon/core/render/picture/composite.hpp"
#include "tests/support/test.hpp"

namespace previz::pipeline::light_figure_test {

constexpr int width = 32, height = 24;

const lighting::Response& response() {
  static const lighting::Response linear = [] {
    ResponseCurve curve;
    curve.kind = ResponseCurve::Kind::linear;
    return lighting::Response(curve, 8);
  }();
  return linear;
}

Plate grey_plate(std::uint16_t code = 100) {
  return {width, height, 8, std::vector<std::uint16_t>(std::size_t{3} * width * height, code)};
}

// A model that is `ratio` times as bright as a plate of this code, with noise that has no mean.
render::Layers model(const glm::dvec3& ratio, std::uint16_t code = 100) {
  render::Layers layers = render::make_layers(width, height, 1);
  layers.white = 2;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> noise(0.5, 1.5);
  for (std::size_t i = 0; i < layers.real.size(); ++i) {
    layers.real[i] = glm::vec3(ratio * noise(random) * 2.0 * response().inverse()[code]);
    layers.depth[i] = 1;
  }
  return layers;
}

// A tile's 48 pixels of 0.29 standard deviations have a mean that is right to 4 %, and the median
// of sixteen tiles to 1.3 %.
TEST(LightFigure, IsTheFactorOfEachChannel) {
  LightComparison comparison;
  comparison.add(model({1.1, 1.6, 1.9}), grey_plate(), response());
  const auto figure = comparison.figure();
  ASSERT_TRUE(figure);
  const glm::dvec3 truth(1.1, 1.6, 1.9);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(figure->ratio[c] / truth[c], 1, 4 * 0.013);
  EXPECT_EQ(figure->tiles, 16u);
  const std::string remark = light_remark(*figure);
  EXPECT_NE(remark.find("1.1 1.6 1.9 times as bright as the picture"), std::string::npos) << remark;
  EXPECT_NE(remark.find("previz calibrate balance"), std::string::npos) << remark;
}

TEST(LightFigure, IsNotRemarkedOnWhereTheModelFits) {
  for (const double ratio : {0.85, 1.0, 1.2}) {
    LightComparison comparison;
    comparison.add(model(glm::dvec3(ratio)), grey_plate(), response());
    ASSERT_TRUE(comparison.figure());
    EXPECT_EQ(light_remark(*comparison.figure()), "") << ratio;
  }
}

// What is virtual, black or clipped, shows no model, or was measured and not traced, says nothing.
TEST(LightFigure, LeavesOutWhatSaysNothing) {
  const auto is_compared = [](const render::Layers& layers, const Plate& plate) {
    LightComparison comparison;
    comparison.add(layers, plate, response());
    return comparison.figure().has_value();
  };
  const glm::dvec3 bright(3);
  ASSERT_TRUE(is_compared(model(bright), grey_plate()));
  render::Layers covered = model(bright), empty = model(bright), measured = model(bright);
  for (float& mask : covered.mask) mask = 0.1f;
  for (float& depth : empty.depth) depth = 0;
  for (glm::vec3& real : measured.real) real = glm::vec3(float(2 * response().inverse()[100]));
  EXPECT_FALSE(is_compared(covered, grey_plate()));
  EXPECT_FALSE(is_compared(empty, grey_plate()));
  EXPECT_FALSE(is_compared(measured, grey_plate()));
  EXPECT_FALSE(is_compared(model(bright), grey_plate(0)));
  EXPECT_FALSE(is_compared(model(bright), grey_plate(255)));
}

}  // namespace previz::pipeline::light_figure_test
