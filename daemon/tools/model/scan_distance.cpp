#include "daemon/tools/model/scan_distance.hpp"

#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>

#include "daemon/tools/model/embree_surface.hpp"

namespace previz::model {
namespace {

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

}  // namespace

struct SurfaceDistance::Impl {
  const std::vector<glm::vec3>& positions;
  const std::vector<unsigned>& indices;
  EmbreeSurface embree{positions, indices, Faces::both};

  struct Query {
    const Impl* surface = nullptr;
    glm::dvec3 point{0};
    double nearest = std::numeric_limits<double>::infinity();
  };

  // Embree calls it with the triangles that may be within the sphere; returns whether the sphere
  // has become smaller.
  static bool look(RTCPointQueryFunctionArguments* found) {
    Query& query = *static_cast<Query*>(found->userPtr);
    const auto corner_at = [&](std::size_t k) {
      const Impl& s = *query.surface;
      return glm::dvec3(s.positions[s.indices[3 * std::size_t{found->primID} + k]]);
    };
    const double distance = glm::distance(
        query.point, nearest_of_triangle(query.point, corner_at(0), corner_at(1), corner_at(2)));
    if (!(distance < query.nearest)) return false;
    query.nearest = distance;
    if (!(distance < static_cast<double>(found->query->radius))) return false;
    found->query->radius = static_cast<float>(distance);
    return true;
  }
};

SurfaceDistance::SurfaceDistance(const std::vector<glm::vec3>& positions,
                                 const std::vector<unsigned>& indices)
    : impl_(new Impl{positions, indices}) {}

SurfaceDistance::~SurfaceDistance() = default;

double SurfaceDistance::from(const glm::vec3& point, double limit) const {
  Impl::Query query;
  query.surface = impl_.get();
  query.point = glm::dvec3(point);
  RTCPointQuery sphere{point.x, point.y, point.z, 0, static_cast<float>(limit)};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(impl_->embree.scene(), &sphere, &context, &Impl::look, &query);
  return query.nearest;
}

}  // namespace previz::model
