// Small frames over an even gray plate, shown one after the other as averaging over frames sees
// them.
#pragma once

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "drivers/plate.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test {

inline constexpr int averaged_width = 64, averaged_height = 48;

inline glm::dmat4 placed_at(const glm::dvec3& place) {
  return glm::translate(glm::dmat4(1.0), place);
}

// Lights the view evenly and gives it a lens for these frames. Codes are linear in radiance.
inline void see_evenly_lit(View& view, const glm::vec3& sky, double horizontal_fov_rad) {
  view.environment = uniform_environment(sky);
  view.calibration = pinhole(averaged_width, averaged_height, horizontal_fov_rad);
  view.calibration.response.kind = ResponseCurve::Kind::linear;
}

inline PlatePtr gray_plate() {
  return std::make_shared<const Plate>(
      Plate{averaged_width, averaged_height, 16,
            std::vector<std::uint16_t>(3 * averaged_width * averaged_height, 20000)});
}

// Renders a frame and returns what is shown of it.
inline Plate shown_frame(SetRenderer& renderer, const glm::dmat4& world_from_camera, int samples,
                         bool accumulates, bool denoise = false) {
  renderer.begin({.plate = gray_plate(),
                  .exposure = 0.5,
                  .world_from_camera = world_from_camera,
                  .accumulates = accumulates});
  renderer.render(samples);
  expect_clean(renderer.counters());
  return renderer.show(denoise);
}

// Returns the root of the summed squares of what two pictures are apart where a mask says that an
// object covers the whole pixel.
inline double apart_where_covered(const Plate& a, const Plate& b, const std::vector<float>& mask) {
  double off = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i)
    if (mask[i / 3] == 1) off += std::pow(a.samples[i] - double(b.samples[i]), 2);
  return std::sqrt(off);
}

}  // namespace previz::test
