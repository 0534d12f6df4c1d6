#include "daemon/render/ray_structures.hpp"

#include "daemon/scene/bvh.hpp"
#include "shaders/lib/shared.h"

namespace previz::render {
namespace {

using Type = vk::AccelerationStructureTypeKHR;
using BuildFlag = vk::BuildAccelerationStructureFlagBitsKHR;

// A vertex is two vectors, of which the first has the position (shaders/lib/scene.glsl,
// "vertices").
constexpr vk::DeviceSize vertex_bytes = 2 * sizeof(glm::vec4);

vk::DeviceOrHostAddressConstKHR in(const Device& device, const Buffer& buffer,
                                   vk::DeviceSize offset = 0) {
  return vk::DeviceOrHostAddressConstKHR(device.vk().getBufferAddress({buffer.buffer}) + offset);
}

vk::TransformMatrixKHR rows_of(const glm::dmat4& m) {
  vk::TransformMatrixKHR rows;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 4; ++c)
      rows.matrix[r][c] = static_cast<float>(m[static_cast<int>(c)][static_cast<int>(r)]);
  return rows;
}

}  // namespace

RayStructures::Mesh RayStructures::mesh_of(const scene::Mesh& from, std::uint32_t first_vertex,
                                           bool deforms) {
  Mesh mesh{.triangles = std::vector(from.triangles.size(), glm::uvec3(0)),
            .first_vertex = first_vertex,
            .vertices = static_cast<std::uint32_t>(from.positions.size()),
            .deforms = deforms};
  for (const std::uint32_t triangle : scene::traced_triangles(from, deforms))
    mesh.triangles[triangle] = from.triangles[triangle];
  return mesh;
}

Purpose RayStructures::for_rays() const {
  return {device_, "the rays that the graphics card's own units trace",
          "simplify the meshes of the set, or set quality.hardware_rays to false"};
}

void RayStructures::build(std::span<const Mesh> meshes, const Buffer& vertices) {
  const Purpose purpose = for_rays();
  meshes_.clear();
  for (const Mesh& from : meshes) {
    MeshStructure& mesh = meshes_.emplace_back();
    mesh.triangles = static_cast<std::uint32_t>(from.triangles.size());
    mesh.first_vertex = from.first_vertex;
    mesh.vertices = from.vertices;
    mesh.deforms = from.deforms;
    if (from.triangles.empty() || from.vertices == 0) continue;
    upload_storage(device_, mesh.indices, from.triangles);
    build(mesh, vertices);
    if (!mesh.deforms) mesh.indices = {};
  }
}

void RayStructures::reshape(std::size_t mesh, const Buffer& vertices) {
  const Purpose purpose = for_rays();
  if (meshes_[mesh].structure.buffer) build(meshes_[mesh], vertices);
}

void RayStructures::build(MeshStructure& mesh, const Buffer& vertices) {
  const vk::AccelerationStructureGeometryTrianglesDataKHR triangles(
      vk::Format::eR32G32B32Sfloat, in(device_, vertices, mesh.first_vertex * vertex_bytes),
      vertex_bytes, mesh.vertices - 1, vk::IndexType::eUint32, in(device_, mesh.indices));
  // A surface that lets light through would take it twice from a ray that is told of it twice.
  const vk::AccelerationStructureGeometryKHR geometry(
      vk::GeometryTypeKHR::eTriangles, triangles,
      vk::GeometryFlagBitsKHR::eNoDuplicateAnyHitInvocation);
  build(mesh.structure, geometry, Type::eBottomLevel,
        mesh.deforms ? BuildFlag::ePreferFastBuild : BuildFlag::ePreferFastTrace, mesh.triangles);
}

void RayStructures::place(std::span<const Instance> instances) {
  const Purpose purpose = for_rays();
  std::vector<vk::AccelerationStructureInstanceKHR> records;
  for (std::uint32_t i = 0; i < instances.size(); ++i) {
    const Instance& instance = instances[i];
    const Buffer& mesh = meshes_[instance.mesh].structure;
    vk::AccelerationStructureInstanceKHR& record = records.emplace_back();
    record.transform = rows_of(instance.placed);
    record.instanceCustomIndex = i & 0xffffffu;
    record.mask = instance.presence & gpu::WORLD_BOTH;
    record.instanceShaderBindingTableRecordOffset = instance.presence & gpu::WORLD_BOTH;
    record.setFlags(instance.is_open ? vk::GeometryInstanceFlagBitsKHR::eForceNoOpaque
                                     : vk::GeometryInstanceFlagBitsKHR::eForceOpaque);
    // An address of 0 makes an instance that is never met.
    if (mesh.buffer && instance.presence != 0)
      record.accelerationStructureReference =
          device_.vk().getAccelerationStructureAddressKHR({mesh.structure});
  }
  upload_storage(device_, instances_, records);
  const vk::AccelerationStructureGeometryInstancesDataKHR data(VK_FALSE, in(device_, instances_));
  build(top_, vk::AccelerationStructureGeometryKHR(vk::GeometryTypeKHR::eInstances, data),
        Type::eTopLevel, BuildFlag::ePreferFastTrace, static_cast<std::uint32_t>(instances.size()));
}

// The memory of a structure that is large enough is used again, and so is that for building.
void RayStructures::build(Buffer& structure, const vk::AccelerationStructureGeometryKHR& geometry,
                          Type type, vk::BuildAccelerationStructureFlagsKHR flags,
                          std::uint32_t count) {
  vk::AccelerationStructureBuildGeometryInfoKHR info(
      type, flags, vk::BuildAccelerationStructureModeKHR::eBuild, {}, {}, geometry);
  const vk::AccelerationStructureBuildSizesInfoKHR sizes =
      device_.vk().getAccelerationStructureBuildSizesKHR(
          vk::AccelerationStructureBuildTypeKHR::eDevice, info, count);
  if (!structure.buffer || structure.size < sizes.accelerationStructureSize)
    structure = create_structure_buffer(device_, sizes.accelerationStructureSize, type);
  const vk::DeviceSize alignment = device_.scratch_alignment();
  if (!scratch_.buffer || scratch_.size < sizes.buildScratchSize + alignment)
    scratch_ = create_storage_buffer(device_, sizes.buildScratchSize + alignment);
  info.dstAccelerationStructure = structure.structure;
  const vk::DeviceAddress scratch = in(device_, scratch_).deviceAddress;
  info.scratchData.deviceAddress = (scratch + alignment - 1) / alignment * alignment;
  const vk::AccelerationStructureBuildRangeInfoKHR range(count, 0, 0, 0);
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    device_.clock().start(
        commands, type == Type::eTopLevel ? "structure of instances" : "structure of a mesh");
    commands.buildAccelerationStructuresKHR(info, &range);
    device_.clock().stop(commands);
    device_.submissions().barrier(commands);
  });
}

}  // namespace previz::render
