#include "daemon/core/tracking/corners.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <opencv2/core.hpp>

#include "drivers/calibration/pinhole.hpp"

namespace previz::tracking {
namespace {

// Returns the homography of the square (-1,-1),(1,-1),(1,1),(-1,1) onto four points (Heckbert
// 1989).
glm::dmat3 square_to_quad(const CornerPixels& q) {
  const glm::dvec2 d1 = q[1] - q[2], d2 = q[3] - q[2], s = q[0] - q[1] + q[2] - q[3];
  const double det = d1.x * d2.y - d2.x * d1.y;
  const double g = (s.x * d2.y - d2.x * s.y) / det, h = (d1.x * s.y - s.x * d1.y) / det;
  const glm::dmat3 from_unit(glm::dvec3(q[1] - q[0] + g * q[1], g),
                             glm::dvec3(q[3] - q[0] + h * q[3], h), glm::dvec3(q[0], 1));
  const glm::dmat3 unit_from_square(glm::dvec3(0.5, 0, 0), glm::dvec3(0, 0.5, 0),
                                    glm::dvec3(0.5, 0.5, 1));
  return from_unit * unit_from_square;
}

glm::dvec2 apply(const glm::dmat3& h, glm::dvec2 p) {
  const glm::dvec3 q = h * glm::dvec3(p, 1);
  return glm::dvec2(q) / q.z;
}

constexpr std::array<glm::dvec2, 4> kSquare{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};

double distance_to_line(glm::dvec2 p, glm::dvec2 a, glm::dvec2 b) {
  const glm::dvec2 d = b - a;
  return std::abs(d.x * (p - a).y - d.y * (p - a).x) / glm::length(d);
}

// Returns the least depth of the ring of cells beside edge k, inside (side -1) or outside (+1), px.
double cell_depth(const CornerPixels& q, const glm::dmat3& h, int k, int cells, int side) {
  const glm::dvec2 a = kSquare[std::size_t(k)], b = kSquare[std::size_t((k + 1) % 4)];
  const glm::dvec2 outward = (a + b) / 2.0;
  double least = HUGE_VAL;
  for (double t : {0.15, 0.5, 0.85}) {
    const glm::dvec2 p = glm::mix(a, b, t) + outward * (side * 2.0 / cells);
    least = std::min(least,
                     distance_to_line(apply(h, p), q[std::size_t(k)], q[std::size_t((k + 1) % 4)]));
  }
  return least;
}

constexpr const char* kEdgeNames[4] = {"lower", "right", "upper", "left"};

}  // namespace

double narrowest_cell_px(const CornerPixels& corners, int cells) {
  const glm::dmat3 h = square_to_quad(corners);
  double least = HUGE_VAL;
  for (int k = 0; k < 4; ++k)
    for (int side : {-1, 1}) least = std::min(least, cell_depth(corners, h, k, cells, side));
  return least;
}

RefinedCorners refine_corners(const Luminance& luminance, const PinholeIntrinsics& lens,
                              const CornerPixels& guess, int cells, bool white_inside, Fit how) {
  RefinedCorners result;
  const glm::dvec2 focal(lens.fx, lens.fy), centre(lens.cx, lens.cy);
  CornerPixels flat;  // on the pinhole plane
  for (std::size_t i = 0; i < 4; ++i) {
    const auto ray = undistort(lens, guess[i]);
    if (!ray) {
      result.trouble = "a corner lies outside the lens model's range";
      return result;
    }
    flat[i] = *ray * focal + centre;
  }
  const glm::dvec2 middle = (flat[0] + flat[1] + flat[2] + flat[3]) / 4.0;
  const glm::dmat3 homography = square_to_quad(flat);

  std::array<EdgeFit, 4> edges;
  for (int k = 0; k < 4; ++k) {
    const std::size_t i = std::size_t(k), j = (i + 1) % 4;
    const glm::dvec2 away = flat[i] + flat[j] - middle;
    const double inside = cell_depth(flat, homography, k, cells, -1);
    const double outside = cell_depth(flat, homography, k, cells, 1);
    const EdgeGuess edge{flat[i], flat[j], white_inside ? middle : away,
                         white_inside ? outside : inside, white_inside ? inside : outside};
    const char* why = "";
    const auto fit = fit_edge(luminance, lens, edge, &why, how);
    if (!fit) {
      result.trouble = std::string("the ") + kEdgeNames[k] + " edge is " + why;
      return result;
    }
    edges[i] = *fit;
  }

  // Corner j is where edges i = j-1 and j meet; offsets e across the edges move it by N^-1 e.
  cv::Matx<double, 8, 8> corner_by_offset = cv::Matx<double, 8, 8>::zeros();
  cv::Matx<double, 8, 8> offsets = cv::Matx<double, 8, 8>::zeros();
  const auto normal_of = [](const EdgeFit& e) {
    const glm::dvec2 d = glm::normalize(e.b - e.a);
    return glm::dvec2(-d.y, d.x);
  };
  for (std::size_t j = 0; j < 4; ++j) {
    const std::size_t i = (j + 3) % 4;
    const EdgeFit &before = edges[i], &after = edges[j];
    const glm::dvec2 n0 = normal_of(before), n1 = normal_of(after);
    const glm::dmat2 normals(n0.x, n1.x, n0.y, n1.y);  // rows n0, n1
    if (std::abs(glm::determinant(normals)) < 0.05) {
      result.trouble = "two edges are nearly parallel";
      return result;
    }
    const glm::dmat2 inverse = glm::inverse(normals);
    const glm::dvec2 u = inverse * glm::dvec2(glm::dot(n0, before.a), glm::dot(n1, after.a));
    glm::dmat2 pixel_by_ray;
    result.pixel[j] = distort(lens, (u - centre) / focal, &pixel_by_ray);
    const glm::dmat2 pixel_by_u(pixel_by_ray[0] / focal.x, pixel_by_ray[1] / focal.y);
    const glm::dmat2 by_offset = pixel_by_u * inverse;
    const int row = int(2 * j), b_of_before = int(2 * i + 1), a_of_after = int(2 * j);
    for (int r = 0; r < 2; ++r) {
      corner_by_offset(row + r, b_of_before) = by_offset[0][r];
      corner_by_offset(row + r, a_of_after) = by_offset[1][r];
    }
    offsets(row, row) = after.var_a;
    offsets(row, row + 1) = offsets(row + 1, row) = after.cov_ab;
    offsets(row + 1, row + 1) = after.var_b;
  }
  const cv::Matx<double, 8, 8> covariance = corner_by_offset * offsets * corner_by_offset.t();
  std::copy(covariance.val, covariance.val + 64, result.covariance.begin());
  return result;
}

}  // namespace previz::tracking
