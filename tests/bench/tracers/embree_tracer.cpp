#include "tests/bench/tracers/embree_tracer.hpp"

#include <limits>

#include "drivers/error.hpp"

namespace previz::bench {
namespace {

RTCRay to_embree(const Ray& ray, std::uint32_t worlds) {
  RTCRay result{};
  result.org_x = ray.origin.x;
  result.org_y = ray.origin.y;
  result.org_z = ray.origin.z;
  result.tnear = ray.t_min;
  result.dir_x = ray.direction.x;
  result.dir_y = ray.direction.y;
  result.dir_z = ray.direction.z;
  result.tfar = ray.t_max;
  result.mask = worlds;
  return result;
}

void attach_mesh(RTCDevice device, RTCScene to, const scene::Mesh& mesh) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* positions = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), mesh.positions.size()));
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(unsigned), mesh.triangles.size()));
  for (const glm::vec3& p : mesh.positions)
    for (int axis = 0; axis < 3; ++axis) *positions++ = p[axis];
  for (const glm::uvec3& t : mesh.triangles)
    for (int corner = 0; corner < 3; ++corner) *indices++ = t[corner];
  rtcSetGeometryMask(geometry, 0xffffffffu);
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(to, geometry);
  rtcReleaseGeometry(geometry);
}

bool is_identity(const glm::dmat4& m) {
  return m == glm::dmat4(1.0);
}

}  // namespace

EmbreeTracer::Scene EmbreeTracer::new_scene(RTCBuildQuality quality, bool robust) const {
  Scene result(rtcNewScene(device_.get()));
  rtcSetSceneBuildQuality(result.get(), quality);
  rtcSetSceneFlags(result.get(), robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
  return result;
}

EmbreeTracer::EmbreeTracer(const scene::Scene& scene, RTCBuildQuality quality, bool robust)
    : device_(rtcNewDevice(nullptr)) {
  if (!device_) throw Error("bench: Embree gives no device");
  for (const scene::Mesh& mesh : scene.meshes) {
    Scene built = new_scene(quality, robust);
    attach_mesh(device_.get(), built.get(), mesh);
    rtcCommitScene(built.get());
    meshes_.push_back(std::move(built));
  }
  single_ = scene.instances.size() == 1 && is_identity(scene.instances[0].world_from_object);
  scene_ = new_scene(quality, robust);
  for (const scene::Instance& instance : scene.instances) {
    RTCGeometry geometry = rtcNewGeometry(device_.get(), RTC_GEOMETRY_TYPE_INSTANCE);
    rtcSetGeometryInstancedScene(geometry, meshes_[instance.mesh].get());
    float columns[16];
    for (int c = 0; c < 4; ++c)
      for (int r = 0; r < 4; ++r)
        columns[4 * c + r] = static_cast<float>(instance.world_from_object[c][r]);
    rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, columns);
    rtcSetGeometryMask(geometry, instance.presence);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_.get(), geometry);
    rtcReleaseGeometry(geometry);
    presence_.push_back(instance.presence);
  }
  rtcCommitScene(scene_.get());
}

TracedHit EmbreeTracer::closest(const Ray& ray, std::uint32_t worlds) const {
  RTCRayHit query{};
  query.ray = to_embree(ray, worlds);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  embree::find_closest(single_ ? meshes_[0].get() : scene_.get(), query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {-1, {}, 0, 0, 0};
  const std::uint32_t instance = single_ ? 0 : query.hit.instID[0];
  return {
      query.ray.tfar, {query.hit.u, query.hit.v}, instance, query.hit.primID, presence_[instance]};
}

bool EmbreeTracer::occluded(const Ray& ray, std::uint32_t worlds) const {
  RTCRay query = to_embree(ray, worlds);
  return embree::is_blocked(single_ ? meshes_[0].get() : scene_.get(), query);
}

}  // namespace previz::bench
