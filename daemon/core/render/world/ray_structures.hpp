// The acceleration structures through which a graphics card's own units trace rays
// (shaders/lib/trace_query.glsl): one for each mesh, and one over the instances. They hold the same
// triangles as the trees of daemon/core/scene/bvh.hpp, under the same numbers.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/core/render/device/buffer.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::render {

class RayStructures {
 public:
  explicit RayStructures(Device& device) : device_(device) {}

  // `triangles` are indices into the mesh's own vertices. Those that no ray may meet are points, so
  // that the others keep their numbers.
  struct Mesh {
    std::vector<glm::uvec3> triangles;
    std::uint32_t first_vertex = 0, vertices = 0;
    bool deforms = false;
  };
  // Leaves out what our own trees do.
  static Mesh mesh_of(const scene::Mesh& mesh, std::uint32_t first_vertex, bool deforms);
  // Frees the structures of all meshes.
  void clear();
  // Builds the structures of the meshes, whose vertices lie in `vertices` as the shaders read them.
  void build(std::span<const Mesh> meshes, const Buffer& vertices);
  // Builds the structure of a mesh that deforms for the vertices that there are now.
  void reshape(std::size_t mesh, const Buffer& vertices);

  struct Instance {
    std::uint32_t mesh = 0;
    std::uint32_t presence = 0;  // WORLD_* bits; 0 is never hit
    glm::dmat4 placed{1.0};      // from object space to that of the rays
    bool is_open = false;        // shaders decide whether a ray meets its surface
  };
  // Builds the structure over the instances, of which a hit names the index.
  void place(std::span<const Instance> instances);
  // The structure over all, for the shaders.
  const Buffer& top() const { return top_; }

 private:
  using Structure = vk::raii::AccelerationStructureKHR;
  struct MeshStructure {
    std::unique_ptr<Structure, Retire<Structure>> structure;  // null: it has no triangle
    vk::DeviceSize first_byte = 0;                            // of its indices
    std::uint32_t triangles = 0, first_vertex = 0, vertices = 0;
    bool deforms = false;
  };

  void upload_indices(std::span<const Mesh> meshes);
  vk::AccelerationStructureGeometryKHR geometry_of(const MeshStructure& mesh,
                                                   const Buffer& vertices) const;
  void record_build(const vk::raii::CommandBuffer& commands, vk::AccelerationStructureKHR structure,
                    vk::AccelerationStructureBuildGeometryInfoKHR info, std::uint32_t count);
  void reserve_scratch(vk::DeviceSize bytes);

  Device& device_;
  Buffer indices_, bottom_;  // of all meshes
  Buffer instances_, top_, scratch_;
  std::vector<MeshStructure> meshes_;  // in `bottom_`, which therefore goes after them
};

}  // namespace previz::render
