// The ways in which the product makes a picture. The extremes hold for each of them, and for the
// picture that is shown, with and without its noise.
#pragma once

#include "daemon/core/lighting/response.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test {

struct Way {
  const char* name;
  set::Estimator estimator;
  set::RealRadiance real_radiance;

  friend void PrintTo(const Way& way, std::ostream* out) { *out << way.name; }
};

inline constexpr Way paired{"Paired", set::Estimator::paired, set::RealRadiance::traced};
inline constexpr Way difference{"Difference", set::Estimator::difference,
                                set::RealRadiance::traced};
inline constexpr Way by_camera{"Camera", set::Estimator::difference, set::RealRadiance::camera};

class EveryWay : public testing::TestWithParam<Way> {};

inline std::string name_of_way(const testing::TestParamInfo<Way>& info) {
  return info.param.name;
}

// What the camera sees of the real world.
struct Seen {
  Plate plate;  // linear codes of 16 bits
  double exposure = 1;
};

// `exposure`: codes end at its inverse.
inline Seen seen_by_camera(const View& view, double exposure, int samples,
                           const set::Estimation& estimation) {
  const render::Layers layers = render_clean(view, samples, estimation).layers;
  Seen seen{{layers.width, layers.height, 16, {}}, exposure};
  for (const glm::vec3& radiance : layers.real)
    for (int c = 0; c < 3; ++c)
      seen.plate.samples.push_back(static_cast<std::uint16_t>(
          std::lround(65535 * std::clamp(exposure * static_cast<double>(radiance[c]), 0.0, 1.0))));
  return seen;
}

// The picture shows the composite: the composite of the layers is made in double precision, the
// picture in single, which may round to the code beside.
inline void expect_shows(const Plate& picture, const render::Layers& layers,
                         const lighting::Response& response, double exposure) {
  ASSERT_EQ(picture.samples.size(), 3 * layers.composite.size());
  for (std::size_t i = 0; i < layers.composite.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      const float value = layers.composite[i][c], variance = layers.variance[i][c];
      ASSERT_TRUE(std::isfinite(value)) << "pixel " << i;
      ASSERT_TRUE(std::isfinite(variance) && variance >= 0) << "pixel " << i << ": " << variance;
      ASSERT_NEAR(picture.samples[3 * i + static_cast<std::size_t>(c)],
                  response.forward(exposure * static_cast<double>(value)), 1)
          << "pixel " << i;
    }
  }
}

// The picture of a view by this way, over what the camera sees; nothing may have been dropped, and
// what is shown is what the layers say. `shown`: the denoised picture.
inline Rendered render_by(const Way& way, View view, const Seen& seen, int samples,
                          set::Estimation estimation, Plate* shown = nullptr) {
  estimation.estimator = way.estimator;
  estimation.real_radiance = way.real_radiance;
  view.calibration.response.kind = ResponseCurve::Kind::linear;
  SetRenderer renderer(view, estimation);
  renderer.begin(
      {std::make_shared<const Plate>(seen.plate), seen.exposure, view.world_from_camera});
  renderer.render(samples);
  Rendered result{renderer.layers(), renderer.counters()};
  const lighting::Response response(view.calibration.response, seen.plate.bits);
  expect_shows(renderer.show(false), result.layers, response, seen.exposure);
  render::Layers denoised = result.layers;
  const Plate picture = renderer.show(true, &denoised);
  expect_shows(picture, denoised, response, seen.exposure);
  if (shown) *shown = picture;
  expect_clean(result.counters);
  return result;
}

}  // namespace previz::test
