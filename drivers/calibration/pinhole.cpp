#include "drivers/calibration/pinhole.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

namespace previz {

glm::dvec2 distort(const PinholeIntrinsics& lens, glm::dvec2 normalised, glm::dmat2* jacobian) {
  const double x = normalised.x, y = normalised.y;
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  const double xd = x * radial + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x);
  const double yd = y * radial + lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y;
  if (jacobian) {
    const double slope =
        2 * (lens.k1 + r2 * (2 * lens.k2 + r2 * 3 * lens.k3));  // dradial/dx over x
    const double cross = x * y * slope + 2 * lens.p1 * x + 2 * lens.p2 * y;
    const double dxdx = radial + x * x * slope + 2 * lens.p1 * y + 6 * lens.p2 * x;
    const double dydy = radial + y * y * slope + 6 * lens.p1 * y + 2 * lens.p2 * x;
    *jacobian = glm::dmat2(lens.fx * dxdx, lens.fy * cross, lens.fx * cross, lens.fy * dydy);
  }
  return {lens.fx * xd + lens.cx, lens.fy * yd + lens.cy};
}

std::optional<glm::dvec2> undistort(const PinholeIntrinsics& lens, glm::dvec2 pixel) {
  glm::dvec2 x((pixel.x - lens.cx) / lens.fx, (pixel.y - lens.cy) / lens.fy);
  for (int i = 0; i < 20; ++i) {
    glm::dmat2 jacobian;
    const glm::dvec2 error = distort(lens, x, &jacobian) - pixel;
    if (!(glm::determinant(jacobian) > 0)) return std::nullopt;
    if (glm::length(error) < 1e-9) return x;
    x -= glm::inverse(jacobian) * error;
  }
  return std::nullopt;
}

}  // namespace previz
