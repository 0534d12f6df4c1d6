// Pictures of tags made by the tests: exact box-filtered edges, lens distortion, blur and noise.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::test {

// Linear radiance, row-major.
struct LinearPicture {
  int width = 0, height = 0;
  std::vector<double> value;
};

// A tag of a family: its cells as libapriltag draws them, and how many of them its border is wide.
struct TagCells {
  int total = 0, border = 0;
  std::vector<std::uint8_t> cells;  // row-major from the top, 0 black
};

TagCells cells_of(const std::string& family, int id);

// Adds `amount` times the fraction of each pixel inside the polygon: exact areas, any winding.
// OpenCV pixel coordinates.
void add_polygon(LinearPicture& picture, const std::vector<glm::dvec2>& polygon, double amount);

struct TagScene {
  PinholeIntrinsics lens;
  glm::dmat4 world_from_camera{1.0};
  std::string family = "tag36h11";
  std::vector<set::Tag> tags;
  double background = 0.25, white = 0.75, black = 0.04;
  double defocus_radius_px = 0;                // uniform disc, by moving the whole picture
  std::array<double, 2> shading_per_px{0, 0};  // relative, about the picture's centre
};

// What the lens sees of the tags (paper: one family's total width), before the sensor.
LinearPicture render(const TagScene& scene);

struct Sensor {
  double full_well_e = 0;  // 0: no noise
  double read_noise_e = 8;
  ResponseCurve response;
  PixelFormat format = PixelFormat::rgb8;
};

// Shot and read noise, clipping, the response curve, rounding. yuv422p8 has even width.
Frame expose(const LinearPicture& picture, const Sensor& sensor, std::mt19937& random);

// A gray8 frame; without bytes it is black.
Frame gray_frame(int width, int height, std::vector<std::uint8_t> bytes = {});

// Where a tag's corners are in the picture.
std::array<glm::dvec2, 4> exact_corners(const TagScene& scene, const set::Tag& tag);

// A camera at `eye` looking at `target` with `up` upwards in the picture.
glm::dmat4 camera_looking(glm::dvec3 eye, glm::dvec3 target, glm::dvec3 up = {0, 0, 1});

// A tag lying at `centre`, turned about its normal, normal along the world's Z unless tilted.
set::Tag flat_tag(int id, double size_m, glm::dvec3 centre, double turn_rad = 0);

// A curve that shows the light as it is.
inline const ResponseCurve linear_response{.kind = ResponseCurve::Kind::linear,
                                           .inverse_table = {}};

PinholeIntrinsics plain_lens(int width, int height, double focal_px);

}  // namespace previz::test
