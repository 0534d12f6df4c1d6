// Shared by the renderer's tests: one device with the validation layer on, and pictures of a view.
#pragma once

#include "daemon/render/renderer.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

// One device a test program; every test ends by asking it for validation messages.
inline const std::shared_ptr<render::Device>& shared_device() {
  static const auto device = render::open_device({.validation = true, .name = ""});
  return device;
}

inline lighting::EnvironmentMap uniform_environment(const glm::vec3& radiance, int size = 4) {
  return {size, std::vector<glm::vec3>(static_cast<std::size_t>(size) * size, radiance)};
}

// Holds a view's scene and environment.
struct SetRenderer : render::Renderer {
  explicit SetRenderer(const View& view, const set::Estimation& estimation = {},
                       std::shared_ptr<render::Device> device = shared_device())
      : render::Renderer(std::move(device), estimation, view.calibration) {
    set_scene(view.scene);
    set_environment(view.environment, set::LightSampling::importance);
  }
};

struct Rendered {
  render::Layers layers;
  render::Counters counters;
};

inline Rendered render_view(const View& view, int samples, const set::Estimation& estimation = {},
                            set::LightSampling sampling = set::LightSampling::importance) {
  render::Renderer renderer(shared_device(), estimation, view.calibration);
  renderer.set_scene(view.scene);
  renderer.set_environment(view.environment, sampling);
  render::FrameInput frame;
  frame.world_from_camera = view.world_from_camera;
  renderer.begin(frame);
  renderer.render(samples);
  return {renderer.layers(), renderer.counters()};
}

inline void expect_clean(const render::Counters& counters) {
  EXPECT_EQ(counters.dropped_not_finite, 0u);
  EXPECT_EQ(counters.dropped_negative, 0u);
  EXPECT_EQ(counters.stopped_in_layers, 0u);
  EXPECT_EQ(counters.unfinished, 0u);
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

// The same, and nothing may have been dropped on the way.
inline Rendered render_clean(const View& view, int samples, const set::Estimation& estimation = {},
                             set::LightSampling sampling = set::LightSampling::importance) {
  Rendered result = render_view(view, samples, estimation, sampling);
  expect_clean(result.counters);
  return result;
}

inline set::Estimation up_to_depth(int max_depth) {
  set::Estimation estimation;
  estimation.max_depth = max_depth;
  return estimation;
}

// Mean of a layer over the picture, per channel, in double precision.
inline glm::dvec3 mean(const std::vector<glm::vec3>& layer) {
  glm::dvec3 sum(0);
  for (const glm::vec3& value : layer) sum += glm::dvec3(value);
  return sum / static_cast<double>(layer.size());
}

// Standard error of that mean, from the renderer's own variance of each pixel's mean (an
// over-estimate, because it ignores that the samples are stratified). For mask = 0 the variance is
// the difference's, so this is for pictures whose mask is 1.
inline glm::dvec3 standard_error(const render::Layers& layers) {
  const auto n = static_cast<double>(layers.variance.size());
  return glm::sqrt(mean(layers.variance) / n);
}

// Standard error of the mean of the green mixed radiance from the spread of the pixels, for
// pictures whose pixels all expect the same value. An over-estimate: neighbours' errors cancel.
inline double standard_error_of_pixels(const render::Layers& layers) {
  const double centre = mean(layers.mixed).g;
  double sum = 0;
  for (const glm::vec3& pixel : layers.mixed) sum += (pixel.g - centre) * (pixel.g - centre);
  const auto n = static_cast<double>(layers.mixed.size());
  return std::sqrt(sum / (n * (n - 1)));
}

}  // namespace previz::test
