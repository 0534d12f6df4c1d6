#include "daemon/tools/model/embree_surface.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

#include "drivers/error.hpp"

namespace previz::model {
namespace {

// Embree calls it for every triangle on a ray, with one ray at a time.
void ignore_backs(const RTCFilterFunctionNArguments* found) {
  if (found->N != 1 || found->valid[0] == 0) return;
  const auto& ray = *reinterpret_cast<const RTCRay*>(found->ray);
  const auto& hit = *reinterpret_cast<const RTCHit*>(found->hit);
  const float along = hit.Ng_x * ray.dir_x + hit.Ng_y * ray.dir_y + hit.Ng_z * ray.dir_z;
  if (along >= 0) found->valid[0] = 0;
}

}  // namespace

EmbreeSurface::EmbreeSurface(const std::vector<glm::vec3>& positions,
                             const std::vector<unsigned>& indices, Faces faces) {
  RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  if (void* vertices =
          rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                  sizeof(glm::vec3), positions.size()))
    std::copy_n(positions.data(), positions.size(), static_cast<glm::vec3*>(vertices));
  if (void* triangles =
          rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                  3 * sizeof(unsigned), indices.size() / 3))
    std::copy_n(indices.data(), indices.size(), static_cast<unsigned*>(triangles));
  if (faces == Faces::front) rtcSetGeometryIntersectFilterFunction(geometry, &ignore_backs);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene_.get());
  if (const RTCError error = rtcGetDeviceError(device_.get()); error != RTC_ERROR_NONE)
    throw Error("Embree cannot build the surface of a scan, error " + std::to_string(error));
}

}  // namespace previz::model
