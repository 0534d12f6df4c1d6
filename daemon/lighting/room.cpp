#include "daemon/lighting/room.hpp"

#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "drivers/embree.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {

Triangles box_triangles(const glm::dvec3& size_m, const glm::dmat4& world_from_box) {
  // Corner i has bit 0 for +X, bit 1 for +Y, bit 2 for +Z; each side lists its four corners in
  // order.
  constexpr std::array<std::array<int, 4>, 6> sides{
      {{0, 2, 6, 4}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 5, 7, 6}}};
  const auto corner = [&](int i) {
    const glm::dvec3 sign(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    return glm::dvec3(world_from_box * glm::dvec4(0.5 * sign * size_m, 1));
  };
  Triangles triangles;
  for (const auto& side : sides)
    for (const std::size_t i : {0, 1, 2, 0, 2, 3}) triangles.push_back(corner(side[i]));
  return triangles;
}

struct Room::Impl {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);

  Impl() = default;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
};

Room::Room(const Triangles& triangles, const glm::dvec3& seen_from)
    : seen_from_(seen_from), impl_(std::make_unique<Impl>()) {
  if (triangles.empty()) throw Error("lighting.room: there is no surface in the room");
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), triangles.size()));
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(unsigned), triangles.size() / 3));
  for (std::size_t v = 0; v < triangles.size(); ++v) {
    const glm::dvec3 place = triangles[v] - seen_from_;
    for (int axis = 0; axis < 3; ++axis) *vertices++ = static_cast<float>(place[axis]);
    indices[v] = static_cast<unsigned>(v);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(impl_->scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);  // no gap between the walls
  rtcCommitScene(impl_->scene);
  if (const RTCError error = rtcGetDeviceError(impl_->device); error != RTC_ERROR_NONE)
    throw Error("lighting.room: Embree cannot build the room, error " + std::to_string(error));
}

Room::~Room() = default;
Room::Room(Room&&) noexcept = default;
Room& Room::operator=(Room&&) noexcept = default;

namespace {

RTCRay room_ray(const glm::dvec3& origin, const glm::dvec3& direction, double end) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x);
  ray.org_y = static_cast<float>(origin.y);
  ray.org_z = static_cast<float>(origin.z);
  ray.dir_x = static_cast<float>(direction.x);
  ray.dir_y = static_cast<float>(direction.y);
  ray.dir_z = static_cast<float>(direction.z);
  ray.tfar = static_cast<float>(end);
  ray.mask = ~0u;
  return ray;
}

}  // namespace

std::optional<double> Room::distance(const glm::dvec3& origin, const glm::dvec3& direction) const {
  RTCRayHit hit{};
  hit.ray = room_ray(origin - seen_from_, direction, std::numeric_limits<float>::infinity());
  hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  embree::find_closest(impl_->scene, hit);
  if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return hit.ray.tfar;
}

bool Room::sees(const glm::dvec3& from, const glm::dvec3& surface_point) const {
  RTCRay ray = room_ray(from - seen_from_, surface_point - from, 0.999);
  return !embree::is_blocked(impl_->scene, ray);
}

}  // namespace previz::lighting
