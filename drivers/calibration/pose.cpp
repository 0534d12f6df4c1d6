#include "drivers/calibration/pose.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include "drivers/keys/value.hpp"

namespace previz {

glm::dmat4 pose(const glm::dvec3& position, const glm::dvec3& angles_rad) {
  auto out = glm::translate(glm::dmat4{1}, position);
  out = glm::rotate(out, angles_rad.z, {0, 0, 1});
  out = glm::rotate(out, angles_rad.y, {0, 1, 0});
  return glm::rotate(out, angles_rad.x, {1, 0, 0});
}

double rigidity_error(const glm::dmat4& transform) {
  const glm::dmat3 r(transform);
  if (!(glm::determinant(r) > 0)) return std::numeric_limits<double>::infinity();
  const auto excess = glm::transpose(r) * r - glm::dmat3{1};
  double worst = 0;
  for (int c = 0; c < 3; ++c)
    for (int i = 0; i < 3; ++i) worst = std::max(worst, std::abs(excess[c][i]));
  return worst;
}

std::string rigidity_fault(const glm::dmat4& transform) {
  const double error = rigidity_error(transform);
  if (error <= rigid_tolerance) return "";
  return std::isinf(error) ? "mirrors or is singular; allowed: a rotation and a translation"
                           : "is not rigid, its axes are off by " + codec::print_number(error) +
                                 "; allowed: unit axes at right angles to within 1e-4";
}

glm::dmat4 nearest_rigid(const glm::dmat4& transform) {
  glm::dmat3 r(transform);
  // Quadratic once near; 60 halvings reach any scale a double can hold a square of.
  for (int i = 0; i < 60 && rigidity_error(glm::dmat4(r)) > 1e-15; ++i)
    r = 0.5 * (r + glm::transpose(glm::inverse(r)));
  glm::dmat4 out(r);
  out[3] = transform[3];
  return out;
}

std::vector<KeyFault> faults(const PoseDraft& draft, const GivenKeys& given,
                             const std::string& matrix_key) {
  const auto matrix = given.find(matrix_key);
  if (matrix == given.end()) {
    if (given.contains("position_m")) return {};
    return {
        {"position_m", "is missing; allowed: position_m (with rotation_deg), or " + matrix_key}};
  }
  std::vector<KeyFault> all;
  for (const char* key : {"position_m", "rotation_deg"})
    if (given.contains(key))
      all.push_back({key, "conflicts with " + matrix_key + "; allowed: one of the two forms"});
  if (const auto fault = matrix->second ? rigidity_fault(*draft.matrix) : ""; !fault.empty())
    all.push_back({matrix_key, fault});
  return all;
}

glm::dmat4 rigid_transform(const PoseDraft& draft) {
  if (draft.matrix) return nearest_rigid(*draft.matrix);
  return pose(draft.position.value_or(glm::dvec3{0}), draft.rotation.value_or(glm::dvec3{0}));
}

}  // namespace previz
