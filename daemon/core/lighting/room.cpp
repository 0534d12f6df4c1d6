#include "daemon/core/lighting/room.hpp"

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

namespace {

// Returns the unit normal of a triangle that is within on_surface_m of a place; nothing if it is
// not.
std::optional<glm::dvec3> normal_of_near(const glm::dvec3* triangle, const glm::dvec3& place) {
  const glm::dvec3 &a = triangle[0], &b = triangle[1], &c = triangle[2];
  const glm::dvec3 normal = glm::cross(b - a, c - a);
  const double area = glm::length(normal);
  if (!(area > 0) || std::abs(glm::dot(place - a, normal)) >= on_surface_m * area) return {};
  for (const auto& [from, to] : {std::pair(a, b), {b, c}, {c, a}}) {
    const glm::dvec3 inwards = glm::cross(normal / area, to - from);
    if (glm::dot(place - from, inwards) < -on_surface_m * glm::length(inwards)) return {};
  }
  return normal / area;
}

}  // namespace

glm::dvec3 off_surfaces(const Triangles& triangles, glm::dvec3 place, const glm::dvec3& camera) {
  for (std::size_t t = 0; t + 2 < triangles.size(); t += 3) {
    auto normal = normal_of_near(&triangles[t], place);
    if (!normal) continue;
    const double side = glm::dot(camera - triangles[t], *normal);
    if (std::abs(side) > on_surface_m ? side < 0 : normal->z < 0) *normal = -*normal;
    place += (on_surface_m - glm::dot(place - triangles[t], *normal)) * *normal;
  }
  return place;
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

RTCRay room_ray(const glm::dvec3& origin, const glm::dvec3& direction, double begin, double end) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x);
  ray.org_y = static_cast<float>(origin.y);
  ray.org_z = static_cast<float>(origin.z);
  ray.dir_x = static_cast<float>(direction.x);
  ray.dir_y = static_cast<float>(direction.y);
  ray.dir_z = static_cast<float>(direction.z);
  ray.tnear = static_cast<float>(begin);
  ray.tfar = static_cast<float>(end);
  ray.mask = ~0u;
  return ray;
}

}  // namespace

std::optional<double> Room::distance(const glm::dvec3& origin, const glm::dvec3& direction) const {
  RTCRayHit hit{};
  hit.ray = room_ray(origin - seen_from_, direction, 0, std::numeric_limits<float>::infinity());
  hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  embree::find_closest(impl_->scene, hit);
  if (hit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return hit.ray.tfar;
}

bool Room::sees(const glm::dvec3& from, const glm::dvec3& surface_point) const {
  constexpr double end = 0.999;
  const double begin = on_surface_m / glm::length(surface_point - from);
  if (!(begin < end)) return true;
  RTCRay ray = room_ray(from - seen_from_, surface_point - from, begin, end);
  return !embree::is_blocked(impl_->scene, ray);
}

}  // namespace previz::lighting
