// Small frames over an even gray plate, shown one after the other as averaging over frames sees
// them.
#pragma once

#include "tests/support/render_fixture.hpp"

namespace previz::test {

inline constexpr int averaged_width = 64, averaged_height = 48;

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

// The same, from where the view's camera is.
inline Plate shown_frame(SetRenderer& renderer, int samples, bool accumulates,
                         bool denoise = false) {
  return shown_frame(renderer, renderer.world_from_camera, samples, accumulates, denoise);
}

// A frame of many samples, and what objects cover of its pixels.
struct Truth {
  Plate picture;
  render::Sheet<float> mask;
};

inline Truth truth_of(SetRenderer& renderer, const glm::dmat4& world_from_camera, int samples) {
  Plate picture = shown_frame(renderer, world_from_camera, samples, false);
  return {std::move(picture), renderer.layers().mask};
}

// Whether an object covers a pixel of this mask, in whole, in part or not at all.
inline bool is_covered(float mask) {
  return mask == 1;
}
inline bool is_outline(float mask) {
  return mask > 0 && mask < 1;
}
inline bool is_uncovered(float mask) {
  return mask == 0;
}

// Returns the root of the summed squares of what a picture is off the truth in pixels of such
// masks.
inline double off_where(bool (*is_wanted)(float mask), const Plate& picture, const Truth& truth) {
  double off = 0;
  for (std::size_t i = 0; i < picture.samples.size(); ++i)
    if (is_wanted(truth.mask[i / 3]))
      off += std::pow(picture.samples[i] - double(truth.picture.samples[i]), 2);
  return std::sqrt(off);
}

// Returns how many codes of two pictures differ by more than their rounding.
inline int differing_codes(const Plate& a, const Plate& b) {
  return std::transform_reduce(
      a.samples.begin(), a.samples.end(), b.samples.begin(), 0, std::plus<>(),
      [](std::uint16_t x, std::uint16_t y) { return std::abs(x - y) > 1 ? 1 : 0; });
}

// A floor, and above it a virtual box, seen from the side.
struct BoxAboveFloor {
  View view;
  std::uint32_t box = 0;

  explicit BoxAboveFloor(const glm::vec3& sky = glm::vec3(0.4f)) {
    scene::Scene& scene = view.scene;
    const std::uint32_t gray = add_material(scene, diffuse(glm::vec3(0.5f)));
    add(scene, rectangle_mesh(glm::dvec2(20)), gray);
    box = add(scene, box_mesh(glm::dvec3(0.4)), gray, at({0, 0, 0.3}), scene::world_mixed);
    see_evenly_lit(view, sky, 0.9);
    view.world_from_camera = look_at({0, -2, 1.4}, {0, 0, 0});
  }

  // Puts a virtual ball of glass in the place of the box, and a lamp above, whose light it gathers.
  void make_glass(double lamp_radiance) {
    scene::Scene& scene = view.scene;
    view.environment = uniform_environment(glm::vec3(0.05f));
    scene.instances[box].mesh = add_mesh(scene, icosphere_mesh(0.3, 4));
    scene.instances[box].material = add_material(scene, glass(1.5f));
    scene.lights = {sphere_lamp({1, 1, 3}, 0.05, glm::dvec3(lamp_radiance))};
  }
};

}  // namespace previz::test
