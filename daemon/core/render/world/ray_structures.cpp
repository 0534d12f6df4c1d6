#include "daemon/core/render/world/ray_structures.hpp"

#include <algorithm>

#include "daemon/core/scene/bvh.hpp"
#include "shaders/lib/shared.h"

namespace previz::render {
namespace {

constexpr Purpose for_rays{
    "the rays that the graphics card traces in hardware",
    "simplify the meshes of the set, or set quality.hardware_rays to false and start previzd "
    "again"};

using Type = vk::AccelerationStructureTypeKHR;
using BuildFlag = vk::BuildAccelerationStructureFlagBitsKHR;
using BuildInfo = vk::AccelerationStructureBuildGeometryInfoKHR;

// A vertex is two vectors, of which the first has the position (shaders/lib/scene.glsl,
// "vertices").
constexpr vk::DeviceSize vertex_bytes = 2 * sizeof(glm::vec4);
constexpr vk::DeviceSize structure_alignment = 256;  // Vulkan's

vk::DeviceSize round_up(vk::DeviceSize value, vk::DeviceSize to) {
  return (value + to - 1) / to * to;
}

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

BuildInfo info_of(const vk::AccelerationStructureGeometryKHR& geometry, Type type, bool deforms) {
  return BuildInfo(type, deforms ? BuildFlag::ePreferFastBuild : BuildFlag::ePreferFastTrace,
                   vk::BuildAccelerationStructureModeKHR::eBuild, {}, {}, geometry);
}

vk::AccelerationStructureBuildSizesInfoKHR sizes_of(const Device& device, const BuildInfo& info,
                                                    std::uint32_t count) {
  return device.vk().getAccelerationStructureBuildSizesKHR(
      vk::AccelerationStructureBuildTypeKHR::eDevice, info, count);
}

}  // namespace

// What is left out becomes a point at a corner of another triangle: its own could be anywhere.
RayStructures::Mesh RayStructures::mesh_of(const scene::Mesh& from, std::uint32_t first_vertex,
                                           bool deforms) {
  const std::vector<std::uint32_t> traced = scene::traced_triangles(from, deforms);
  if (traced.empty()) return {};
  Mesh mesh{.triangles = {},
            .first_vertex = first_vertex,
            .vertices = static_cast<std::uint32_t>(from.positions.size()),
            .deforms = deforms};
  mesh.triangles.assign(from.triangles.size(), glm::uvec3(from.triangles[traced[0]].x));
  for (const std::uint32_t triangle : traced) mesh.triangles[triangle] = from.triangles[triangle];
  return mesh;
}

void RayStructures::clear() {
  meshes_.clear();
  for (Buffer* buffer : {&indices_, &bottom_, &scratch_}) *buffer = {};
}

void RayStructures::upload_indices(std::span<const Mesh> meshes) {
  std::vector<glm::uvec3> indices;
  for (const Mesh& from : meshes) {
    meshes_.push_back({.structure = {},
                       .first_byte = indices.size() * sizeof(glm::uvec3),
                       .triangles = static_cast<std::uint32_t>(from.triangles.size()),
                       .first_vertex = from.first_vertex,
                       .vertices = from.vertices,
                       .deforms = from.deforms});
    indices.insert(indices.end(), from.triangles.begin(), from.triangles.end());
  }
  upload_storage(device_, for_rays, indices_, indices);
}

void RayStructures::build(std::span<const Mesh> meshes, const Buffer& vertices) {
  clear();
  upload_indices(meshes);
  std::vector<vk::DeviceSize> sizes;
  vk::DeviceSize all = 0, most_scratch = 0, most_later = 0;
  for (const MeshStructure& mesh : meshes_) {
    const auto geometry = geometry_of(mesh, vertices);
    const auto needed =
        sizes_of(device_, info_of(geometry, Type::eBottomLevel, mesh.deforms), mesh.triangles);
    sizes.push_back(mesh.triangles > 0 ? needed.accelerationStructureSize : 0);
    all += round_up(sizes.back(), structure_alignment);
    most_scratch = std::max(most_scratch, needed.buildScratchSize);
    if (mesh.deforms) most_later = std::max(most_later, needed.buildScratchSize);
  }
  bottom_ = create_structure_memory(device_, for_rays, all);
  reserve_scratch(most_scratch);
  vk::DeviceSize offset = 0;
  for (std::size_t i = 0; i < meshes_.size(); ++i) {
    if (sizes[i] == 0) continue;
    meshes_[i].structure = {
        new Structure(device_.vk(), vk::AccelerationStructureCreateInfoKHR(
                                        {}, bottom_.buffer, offset, sizes[i], Type::eBottomLevel)),
        Retire<Structure>{&device_}};
    offset += round_up(sizes[i], structure_alignment);
    reshape(i, vertices);
  }
  scratch_ = {};
  if (most_later > 0) return reserve_scratch(most_later);
  indices_ = {};
}

vk::AccelerationStructureGeometryKHR RayStructures::geometry_of(const MeshStructure& mesh,
                                                                const Buffer& vertices) const {
  const vk::AccelerationStructureGeometryTrianglesDataKHR triangles(
      vk::Format::eR32G32B32Sfloat, in(device_, vertices, mesh.first_vertex * vertex_bytes),
      vertex_bytes, std::max(mesh.vertices, 1u) - 1, vk::IndexType::eUint32,
      in(device_, indices_, mesh.first_byte));
  // A surface that lets light through would take it twice from a ray that is told of it twice.
  return {vk::GeometryTypeKHR::eTriangles, triangles,
          vk::GeometryFlagBitsKHR::eNoDuplicateAnyHitInvocation};
}

void RayStructures::reshape(std::size_t index, const Buffer& vertices) {
  const MeshStructure& mesh = meshes_[index];
  if (!mesh.structure) return;
  const auto geometry = geometry_of(mesh, vertices);
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    record_build(commands, **mesh.structure, info_of(geometry, Type::eBottomLevel, mesh.deforms),
                 mesh.triangles);
  });
}

void RayStructures::place(std::span<const Instance> instances) {
  std::vector<vk::AccelerationStructureInstanceKHR> records;
  for (std::uint32_t i = 0; i < instances.size(); ++i) {
    const Instance& instance = instances[i];
    const MeshStructure& mesh = meshes_[instance.mesh];
    vk::AccelerationStructureInstanceKHR& record = records.emplace_back();
    record.transform = rows_of(instance.placed);
    record.instanceCustomIndex = i & 0xffffffu;
    record.mask = instance.presence & gpu::WORLD_BOTH;
    record.instanceShaderBindingTableRecordOffset = instance.presence & gpu::WORLD_BOTH;
    record.setFlags(instance.is_open ? vk::GeometryInstanceFlagBitsKHR::eForceNoOpaque
                                     : vk::GeometryInstanceFlagBitsKHR::eForceOpaque);
    // An address of 0 makes an instance that is never met.
    if (mesh.structure && instance.presence != 0)
      record.accelerationStructureReference =
          device_.vk().getAccelerationStructureAddressKHR({**mesh.structure});
  }
  upload_storage(device_, for_rays, instances_, records);
  const vk::AccelerationStructureGeometryKHR geometry(
      vk::GeometryTypeKHR::eInstances,
      vk::AccelerationStructureGeometryInstancesDataKHR(VK_FALSE, in(device_, instances_)));
  const BuildInfo info = info_of(geometry, Type::eTopLevel, false);
  const auto count = static_cast<std::uint32_t>(instances.size());
  const auto sizes = sizes_of(device_, info, count);
  if (!top_.buffer || top_.size < sizes.accelerationStructureSize) {
    top_ = {};
    top_ = create_structure_buffer(device_, for_rays, sizes.accelerationStructureSize,
                                   Type::eTopLevel);
  }
  reserve_scratch(sizes.buildScratchSize);
  device_.record([&](const vk::raii::CommandBuffer& commands) {
    record_build(commands, top_.structure, info, count);
  });
}

void RayStructures::reserve_scratch(vk::DeviceSize bytes) {
  bytes += device_.scratch_alignment();
  if (scratch_.buffer && scratch_.size >= bytes) return;
  scratch_ = {};
  scratch_ = create_structure_memory(device_, for_rays, bytes);
}

// One build after another uses the scratch memory.
void RayStructures::record_build(const vk::raii::CommandBuffer& commands,
                                 vk::AccelerationStructureKHR structure, BuildInfo info,
                                 std::uint32_t count) {
  info.dstAccelerationStructure = structure;
  info.scratchData.deviceAddress =
      round_up(in(device_, scratch_).deviceAddress, device_.scratch_alignment());
  const vk::AccelerationStructureBuildRangeInfoKHR range(count, 0, 0, 0);
  device_.clock().start(
      commands, info.type == Type::eTopLevel ? "structure of objects" : "structure of a mesh");
  commands.buildAccelerationStructuresKHR(info, &range);
  device_.clock().stop(commands);
  device_.submissions().barrier(commands);
}

}  // namespace previz::render
