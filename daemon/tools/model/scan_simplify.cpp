#include "daemon/tools/model/scan_simplify.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "daemon/tools/model/scan_distance.hpp"

namespace previz::model {
namespace {

// The first trial's error is the one wanted; each further one is smaller.
constexpr int most_trials = 8;
// Distances are measured up to so many times the one wanted.
constexpr double measured_up_to = 4;

}  // namespace

double largest_distance(const TriangleMesh& mesh, const std::vector<unsigned>& surface,
                        double limit) {
  if (surface.empty()) return std::numeric_limits<double>::infinity();
  const SurfaceDistance measured(mesh.positions, surface);
  std::vector<bool> is_used(mesh.positions.size()), is_corner(mesh.positions.size());
  for (const unsigned v : mesh.indices) is_used[v] = true;
  for (const unsigned v : surface) is_corner[v] = true;
  double most = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (is_used[v] && !is_corner[v] && std::isfinite(most))
      most = std::max(most, measured.from(mesh.positions[v], limit));
  return most;
}

Simplified simplified(TriangleMesh mesh, double most) {
  if (!(most > 0) || mesh.indices.empty()) return {std::move(mesh), 0};
  const float* const positions = &mesh.positions.front().x;
  const float scale = meshopt_simplifyScale(positions, mesh.positions.size(), sizeof(glm::vec3));
  std::vector<unsigned> fewer(mesh.indices.size());
  double guide = most;
  for (int trial = 0; trial < most_trials && scale > 0; ++trial) {
    fewer.resize(mesh.indices.size());
    fewer.resize(meshopt_simplify(
        fewer.data(), mesh.indices.data(), mesh.indices.size(), positions, mesh.positions.size(),
        sizeof(glm::vec3), 0, static_cast<float>(guide / static_cast<double>(scale)), 0, nullptr));
    const double error = largest_distance(mesh, fewer, measured_up_to * most);
    if (error <= most) return {{std::move(mesh.positions), std::move(fewer)}, error};
    guide *= std::isfinite(error) ? std::clamp(0.9 * most / error, 0.4, 0.8) : 0.4;
  }
  return {std::move(mesh), 0};
}

}  // namespace previz::model
