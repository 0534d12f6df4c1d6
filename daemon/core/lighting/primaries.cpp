#include "daemon/core/lighting/primaries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <opencv2/core.hpp>

namespace previz::lighting {
namespace {

// XYZ of a chromaticity, of any brightness.
cv::Vec3d xyz(const std::array<double, 2>& xy) {
  return {xy[0], xy[1], 1 - xy[0] - xy[1]};
}

// XYZ of a white, as bright as Y = 1.
cv::Vec3d bright(const std::array<double, 2>& white) {
  return xyz(white) * (1 / white[1]);
}

// XYZ from linear RGB (SMPTE RP 177).
cv::Matx33d xyz_from(const Chromaticities& c) {
  cv::Matx33d columns;
  for (int i = 0; i < 3; ++i)
    for (int row = 0; row < 3; ++row) columns(row, i) = xyz(c[static_cast<std::size_t>(i)])[row];
  const cv::Vec3d scales = columns.inv() * bright(c[3]);
  return columns * cv::Matx33d::diag(scales);
}

// Turns one white into another as the eye adapts (Lam 1985, "Bradford").
cv::Matx33d adapted(const cv::Vec3d& from, const cv::Vec3d& to) {
  const cv::Matx33d cones(0.8951, 0.2664, -0.1614, -0.7502, 1.7135, 0.0367, 0.0389, -0.0685,
                          1.0296);
  const cv::Vec3d before = cones * from, after = cones * to;
  const cv::Vec3d ratio(after[0] / before[0], after[1] / before[1], after[2] / before[2]);
  return cones.inv() * cv::Matx33d::diag(ratio) * cones;
}

// OpenCV's inverse of a singular matrix is zero, and a white without brightness is infinite. No
// primaries that something was filmed with need a factor of ten.
std::optional<ColorMatrix> sound(const cv::Matx33d& matrix) {
  constexpr double most_factor = 1000;
  ColorMatrix rows{};
  std::copy_n(matrix.val, rows.size(), rows.begin());
  if (!std::ranges::all_of(rows, [](double value) { return std::abs(value) < most_factor; }) ||
      std::abs(cv::determinant(matrix)) < 1e-6)
    return std::nullopt;
  return rows;
}

}  // namespace

std::optional<ColorMatrix> rec709_from(const Chromaticities& from) {
  return sound(xyz_from(rec709).inv() * adapted(bright(from[3]), bright(rec709[3])) *
               xyz_from(from));
}

std::optional<ColorMatrix> rec709_from_xyz(const std::array<double, 2>& white) {
  return sound(xyz_from(rec709).inv() * adapted(bright(white), bright(d65)));
}

bool is_rec709(const Chromaticities& chromaticities) {
  constexpr double digits = 1e-3;
  for (std::size_t i = 0; i < rec709.size(); ++i)
    for (std::size_t axis = 0; axis < 2; ++axis)
      if (!(std::abs(chromaticities[i][axis] - rec709[i][axis]) < digits)) return false;
  return true;
}

void convert(std::span<glm::vec3> pixels, const ColorMatrix& m) {
  for (glm::vec3& pixel : pixels) {
    const glm::dvec3 p(pixel);
    const glm::vec3 converted(m[0] * p.r + m[1] * p.g + m[2] * p.b,
                              m[3] * p.r + m[4] * p.g + m[5] * p.b,
                              m[6] * p.r + m[7] * p.g + m[8] * p.b);
    if (std::isfinite(p.r + p.g + p.b)) pixel = converted;
  }
}

void convert_light(std::span<glm::vec3> pixels, const ColorMatrix& matrix,
                   const std::filesystem::path& path, std::vector<std::string>& notes) {
  constexpr float rounding = 1.0f / 256;  // of RGBE, by the brightest channel
  std::size_t saturated = 0;
  for (glm::vec3& pixel : pixels) {
    const glm::vec3 own = pixel;
    convert({&pixel, 1}, matrix);
    const float least = -rounding * std::max({pixel.r, pixel.g, pixel.b});
    bool is_saturated = false;
    for (int c = 0; c < 3; ++c)
      if (pixel[c] < 0 && own[c] >= 0) {
        is_saturated |= pixel[c] < least;
        pixel[c] = 0;
      }
    saturated += is_saturated;
  }
  if (saturated > 0)
    notes.push_back(
        fmt::format("{}: {} of {} pixels {} more saturated than Rec. 709 can show, and {} shown at "
                    "its edge",
                    path.string(), saturated, pixels.size(), saturated == 1 ? "is" : "are",
                    saturated == 1 ? "is" : "are"));
}

}  // namespace previz::lighting
