// Shared by the renderer's tests: one device with the validation layer on, and pictures of a view.
#pragma once

#include <mutex>

#include "daemon/core/render/renderer.hpp"
#include "drivers/plate.hpp"
#include "tests/support/scenes.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

// The device of shared_device(), which ends with the tests: at the program's exit, the validation
// layer's own data may be gone before it (1.4.309, Debian 13).
struct KeptDevice : testing::Environment {
  void TearDown() override { device.reset(); }
  static inline std::mutex mutex;
  static inline std::shared_ptr<render::Device> device;
};
inline testing::Environment* const ends_the_device =
    testing::AddGlobalTestEnvironment(new KeptDevice);

// One device a test program; every test ends by asking it for validation messages. With
// PREVIZ_AS_GPU in the environment a CPU device is treated as a graphics card, and if that is
// "integrated", as one that is part of the processor. With PREVIZ_HARDWARE_RAYS it traces rays as
// the units of one do.
inline const std::shared_ptr<render::Device>& shared_device() {
  const std::scoped_lock lock(KeptDevice::mutex);
  if (!KeptDevice::device) {
    const char* as = std::getenv("PREVIZ_AS_GPU");
    render::DeviceOptions options{.validation = true, .name = ""};
    options.as_gpu = as != nullptr;
    options.as_integrated = as && std::string_view(as) == "integrated";
    if (std::getenv("PREVIZ_HARDWARE_RAYS")) options.hardware_rays = true;
    KeptDevice::device = render::open_device(options);
  }
  return KeptDevice::device;
}

inline void expect_clean(const render::Counters& counters) {
  EXPECT_EQ(counters.dropped_not_finite, 0u);
  EXPECT_EQ(counters.dropped_negative, 0u);
  EXPECT_EQ(counters.stopped_in_layers, 0u);
  EXPECT_EQ(counters.unfinished, 0u);
  EXPECT_EQ(render::validation_messages(*shared_device()), 0u);
}

// Holds a view's scene and environment.
struct SetRenderer : render::Renderer {
  explicit SetRenderer(const View& view, const set::Estimation& estimation = {},
                       set::LightSampling sampling = set::LightSampling::importance,
                       std::shared_ptr<render::Device> device = shared_device())
      : render::Renderer(std::move(device), estimation, view.calibration),
        world_from_camera(view.world_from_camera) {
    set_scene(view.scene);
    set_environment(view.environment, sampling);
  }

  // Renders a frame that stands alone, from where the view's camera is.
  render::Layers rendered(int samples, std::optional<std::uint32_t> seed = {}) {
    begin({{}, 1.0, world_from_camera, seed});
    render(samples);
    return layers();
  }
  // The same, and nothing may have been dropped on the way.
  render::Layers rendered_clean(int samples, std::optional<std::uint32_t> seed = {}) {
    render::Layers result = rendered(samples, seed);
    expect_clean(counters());
    return result;
  }

  glm::dmat4 world_from_camera;
};

struct Rendered {
  render::Layers layers;
  render::Counters counters;
};

inline Rendered render_view(const View& view, int samples, const set::Estimation& estimation = {},
                            set::LightSampling sampling = set::LightSampling::importance) {
  SetRenderer renderer(view, estimation, sampling);
  render::Layers layers = renderer.rendered(samples);
  return {std::move(layers), renderer.counters()};
}

// The same, and nothing may have been dropped on the way.
inline Rendered render_clean(const View& view, int samples, const set::Estimation& estimation = {},
                             set::LightSampling sampling = set::LightSampling::importance) {
  Rendered result = render_view(view, samples, estimation, sampling);
  expect_clean(result.counters);
  return result;
}

inline set::Estimation up_to_depth(int max_depth,
                                   set::Estimator estimator = set::Estimator::paired) {
  return {.estimator = estimator, .max_depth = max_depth};
}

inline constexpr set::Estimator both_estimators[] = {set::Estimator::paired,
                                                     set::Estimator::difference};
inline constexpr set::Composite all_composites[] = {set::Composite::additive, set::Composite::ratio,
                                                    set::Composite::hybrid};

struct Pixel {
  int x, y;
  std::size_t i;  // in a layer
};

// All pixels of a picture, row by row.
inline std::vector<Pixel> pixels_of(int width, int height) {
  std::vector<Pixel> pixels;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) pixels.push_back({x, y, pixels.size()});
  return pixels;
}

// What a sensor sees of a layer whose codes of 16 bits are linear and end at `white`.
Plate linear_plate(int width, int height, const auto& layer, double white) {
  Plate plate{width, height, 16, {}};
  for (const glm::dvec3 radiance : layer)
    for (int c = 0; c < 3; ++c)
      plate.samples.push_back(static_cast<std::uint16_t>(
          std::lround(65535 * std::clamp(radiance[c] / white, 0.0, 1.0))));
  return plate;
}

inline void expect_near(const glm::dvec3& found, const glm::dvec3& expected,
                        const glm::dvec3& bound) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected[c], bound[c]) << "channel " << c;
}
inline void expect_near(const glm::dvec3& found, const glm::dvec3& expected, double bound) {
  expect_near(found, expected, glm::dvec3(bound));
}

// Mean of a layer over the picture, per channel, in double precision.
inline glm::dvec3 mean(std::span<const glm::vec3> layer) {
  glm::dvec3 sum(0);
  for (const glm::vec3& value : layer) sum += glm::dvec3(value);
  return sum / static_cast<double>(layer.size());
}

// The mean of independent values by channel, and its standard error.
struct Estimate {
  glm::dvec3 mean{0}, error{0};
};

inline Estimate estimate_of(const std::vector<glm::dvec3>& values) {
  const auto n = static_cast<double>(values.size());
  Estimate result;
  glm::dvec3 squares(0);
  for (const glm::dvec3& value : values) {
    result.mean += value / n;
    squares += value * value / n;
  }
  const glm::dvec3 variance = glm::max(squares - result.mean * result.mean, 0.0);
  result.error = glm::sqrt(variance / (n - 1));
  return result;
}

// Standard error of the mean of a layer, from the renderer's own variance of each pixel's mean (an
// over-estimate, because it ignores that the samples are stratified). For mask = 0 the variance is
// the difference's, so this is for pictures whose mask is 1.
inline glm::dvec3 standard_error(const render::Layers& layers) {
  const auto n = static_cast<double>(layers.variance.size());
  return glm::sqrt(mean(layers.variance) / n);
}

// Standard error of the mean of the mixed radiance from the spread of the pixels, by channel and of
// green, for pictures whose pixels all expect the same value. An over-estimate: neighbours' errors
// cancel.
inline glm::dvec3 standard_errors_of_pixels(const render::Layers& layers) {
  const glm::dvec3 centre = mean(layers.mixed);
  glm::dvec3 sum(0);
  for (const glm::dvec3 pixel : layers.mixed) sum += (pixel - centre) * (pixel - centre);
  const auto n = static_cast<double>(layers.mixed.size());
  return glm::sqrt(sum / (n * (n - 1)));
}
inline double standard_error_of_pixels(const render::Layers& layers) {
  return standard_errors_of_pixels(layers).g;
}

}  // namespace previz::test
