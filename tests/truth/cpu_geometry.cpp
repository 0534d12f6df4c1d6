#include "tests/truth/cpu_geometry.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_inverse.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <string>
#include <vector>

#include "drivers/embree.hpp"
#include "drivers/error.hpp"

namespace previz::truth {
namespace {

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using DeviceHandle = std::unique_ptr<RTCDeviceTy, DeviceRelease>;
using SceneHandle = std::unique_ptr<RTCSceneTy, SceneRelease>;

void throw_embree(void*, RTCError, const char* message) {
  throw Error(std::string("reference tracer: Embree: ") + message);
}

SceneHandle new_scene(RTCDevice device) {
  SceneHandle scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  return scene;
}

SceneHandle build_mesh(RTCDevice device, const scene::Mesh& mesh) {
  SceneHandle scene = new_scene(device);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<glm::vec3*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              sizeof(glm::vec3), mesh.positions.size()));
  std::copy(mesh.positions.begin(), mesh.positions.end(), vertices);
  auto* indices = static_cast<glm::uvec3*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              sizeof(glm::uvec3), mesh.triangles.size()));
  std::copy(mesh.triangles.begin(), mesh.triangles.end(), indices);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene.get(), geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene.get());
  return scene;
}

RTCRay to_embree(const Ray& ray, double distance) {
  RTCRay r{};
  r.org_x = static_cast<float>(ray.origin.x);
  r.org_y = static_cast<float>(ray.origin.y);
  r.org_z = static_cast<float>(ray.origin.z);
  r.dir_x = static_cast<float>(ray.direction.x);
  r.dir_y = static_cast<float>(ray.direction.y);
  r.dir_z = static_cast<float>(ray.direction.z);
  r.tfar = static_cast<float>(distance);
  r.mask = 0xffffffffu;
  return r;
}

}  // namespace

struct Geometry::Impl {
  const scene::Scene& scene;
  DeviceHandle device;
  std::vector<SceneHandle> meshes;
  SceneHandle worlds[3];  // world - 1
  std::vector<glm::dmat4> placed_from_object;
};

Geometry::Geometry(const scene::Scene& scene)
    : impl_(new Impl{scene, DeviceHandle(rtcNewDevice("threads=2")), {}, {}, {}}) {
  rtcSetDeviceErrorFunction(impl_->device.get(), throw_embree, nullptr);
  for (const scene::Mesh& mesh : scene.meshes) {
    impl_->meshes.push_back(build_mesh(impl_->device.get(), mesh));
  }
  place(glm::dvec3(0));
}

Geometry::~Geometry() = default;

void Geometry::place(const glm::dvec3& origin) {
  impl_->placed_from_object.clear();
  for (SceneHandle& world : impl_->worlds) world = new_scene(impl_->device.get());
  for (std::uint32_t i = 0; i < impl_->scene.instances.size(); ++i) {
    const scene::Instance& instance = impl_->scene.instances[i];
    glm::dmat4 placed = instance.world_from_object;
    placed[3] -= glm::dvec4(origin, 0);
    impl_->placed_from_object.push_back(placed);

    RTCGeometry geometry = rtcNewGeometry(impl_->device.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, impl_->meshes[instance.mesh].get());
    const glm::mat4 transform(placed);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, &transform[0][0]);
    rtcCommitGeometry(geometry);
    for (std::uint32_t world = 1; world <= 3; ++world) {
      if (instance.presence & world) {
        rtcAttachGeometryByID(impl_->worlds[world - 1].get(), geometry, i);
      }
    }
    rtcReleaseGeometry(geometry);
  }
  for (SceneHandle& world : impl_->worlds) rtcCommitScene(world.get());
}

std::optional<Hit> Geometry::closest(const Ray& ray, std::uint32_t world) const {
  RTCRayHit query{};
  query.ray = to_embree(ray, std::numeric_limits<float>::infinity());
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embree::find_closest(impl_->worlds[world - 1].get(), query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

  Hit hit;
  hit.instance = query.hit.instID[0];
  hit.triangle = query.hit.primID;
  const scene::Mesh& mesh = impl_->scene.meshes[impl_->scene.instances[hit.instance].mesh];
  const glm::dmat4& placed = impl_->placed_from_object[hit.instance];
  const Triangle t = triangle(hit.instance, hit.triangle);
  const double u = query.hit.u;
  const double v = query.hit.v;
  hit.position = (1 - u - v) * t.v0 + u * t.v1 + v * t.v2;
  hit.distance = glm::dot(hit.position - ray.origin, ray.direction);

  const glm::dmat3 linear(placed);
  const double side = glm::determinant(linear) < 0 ? -1 : 1;
  hit.geometric_normal = side * glm::normalize(glm::cross(t.v1 - t.v0, t.v2 - t.v0));
  const glm::uvec3 vertex = mesh.triangles[hit.triangle];
  const glm::dvec3 normal = (1 - u - v) * glm::dvec3(mesh.normals[vertex.x]) +
                            u * glm::dvec3(mesh.normals[vertex.y]) +
                            v * glm::dvec3(mesh.normals[vertex.z]);
  const glm::dvec3 shading = glm::inverseTranspose(linear) * normal;
  hit.shading_normal = glm::length(shading) > 0 ? glm::normalize(shading) : hit.geometric_normal;
  if (glm::dot(hit.shading_normal, hit.geometric_normal) < 0) {
    hit.shading_normal = -hit.shading_normal;
  }
  hit.weights = {1 - u - v, u, v};
  // Embree traces in single precision, in world and in object space: 2^-23 of the larger
  // coordinate is its rounding, 2^-19 leaves room for the sums in between.
  const glm::dvec3 in_object = hit.position - glm::dvec3(placed[3]);
  hit.offset = 0x1p-19 * std::max(glm::length(hit.position), glm::length(in_object));
  return hit;
}

bool Geometry::blocked(const Ray& ray, double distance, std::uint32_t world) const {
  RTCRay query = to_embree(ray, distance);
  return embree::is_blocked(impl_->worlds[world - 1].get(), query);
}

Triangle Geometry::triangle(std::uint32_t instance, std::uint32_t index) const {
  const scene::Mesh& mesh = impl_->scene.meshes[impl_->scene.instances[instance].mesh];
  const glm::dmat4& placed = impl_->placed_from_object[instance];
  const glm::uvec3 vertex = mesh.triangles[index];
  const auto corner = [&](std::uint32_t i) {
    return glm::dvec3(placed * glm::dvec4(glm::dvec3(mesh.positions[i]), 1));
  };
  return {corner(vertex.x), corner(vertex.y), corner(vertex.z)};
}

}  // namespace previz::truth
