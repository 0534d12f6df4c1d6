#include "daemon/model/scan_simplify.hpp"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "drivers/embree.hpp"
#include "drivers/error.hpp"

namespace previz::model {
namespace {

// The first trial's error is the one wanted; each further one is smaller.
constexpr int most_trials = 8;
// Distances are measured up to so many times the one wanted.
constexpr double measured_up_to = 4;

// Returns the point of triangle abc that is nearest to p (Ericson, Real-Time Collision Detection,
// 5.1.5).
glm::dvec3 nearest_of_triangle(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b,
                               const glm::dvec3& c) {
  const glm::dvec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = glm::dot(ab, ap), d2 = glm::dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const double d3 = glm::dot(ab, bp), d4 = glm::dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const double d5 = glm::dot(ab, cp), d6 = glm::dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) return b + (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b);
  return a + (vb * ab + vc * ac) / (va + vb + vc);
}

struct ReleaseEmbree {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};

// A surface that distances are measured from.
class Surface {
 public:
  Surface(const std::vector<glm::vec3>& positions, const std::vector<unsigned>& indices)
      : positions_(positions),
        indices_(indices),
        device_(rtcNewDevice(nullptr)),
        scene_(rtcNewScene(device_.get())) {
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    if (void* vertices =
            rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                    sizeof(glm::vec3), positions.size()))
      std::copy_n(positions.data(), positions.size(), static_cast<glm::vec3*>(vertices));
    if (void* triangles =
            rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                    3 * sizeof(unsigned), indices.size() / 3))
      std::copy_n(indices.data(), indices.size(), static_cast<unsigned*>(triangles));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_.get(), geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_.get());
    if (const RTCError error = rtcGetDeviceError(device_.get()); error != RTC_ERROR_NONE)
      throw Error("Embree cannot build the simplified surface, error " + std::to_string(error));
  }

  // Returns infinity beyond `limit`.
  double distance(const glm::vec3& from, double limit) const {
    Query query{this, glm::dvec3(from), std::numeric_limits<double>::infinity()};
    RTCPointQuery sphere{from.x, from.y, from.z, 0, static_cast<float>(limit)};
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    rtcPointQuery(scene_.get(), &sphere, &context, &Surface::look, &query);
    return query.nearest;
  }

 private:
  struct Query {
    const Surface* surface = nullptr;
    glm::dvec3 from{0};
    double nearest = 0;
  };

  // Embree calls it with the triangles that may be within the sphere; returns whether the sphere
  // has become smaller.
  static bool look(RTCPointQueryFunctionArguments* found) {
    Query& query = *static_cast<Query*>(found->userPtr);
    const auto corner = [&](std::size_t k) {
      const Surface& s = *query.surface;
      return glm::dvec3(s.positions_[s.indices_[3 * std::size_t{found->primID} + k]]);
    };
    const double distance =
        glm::distance(query.from, nearest_of_triangle(query.from, corner(0), corner(1), corner(2)));
    if (!(distance < query.nearest)) return false;
    query.nearest = distance;
    if (!(distance < static_cast<double>(found->query->radius))) return false;
    found->query->radius = static_cast<float>(distance);
    return true;
  }

  const std::vector<glm::vec3>& positions_;
  const std::vector<unsigned>& indices_;
  std::unique_ptr<RTCDeviceTy, ReleaseEmbree> device_;
  std::unique_ptr<RTCSceneTy, ReleaseEmbree> scene_;
};

}  // namespace

double largest_distance(const TriangleMesh& mesh, const std::vector<unsigned>& surface,
                        double limit) {
  if (surface.empty()) return std::numeric_limits<double>::infinity();
  const Surface measured(mesh.positions, surface);
  std::vector<bool> is_used(mesh.positions.size()), is_corner(mesh.positions.size());
  for (const unsigned v : mesh.indices) is_used[v] = true;
  for (const unsigned v : surface) is_corner[v] = true;
  double most = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    if (is_used[v] && !is_corner[v] && std::isfinite(most))
      most = std::max(most, measured.distance(mesh.positions[v], limit));
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
