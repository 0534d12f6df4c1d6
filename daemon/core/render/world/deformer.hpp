// Gives the meshes that deform their shapes on the GPU: vertices first, then the boxes of their
// trees (shaders/README.md, "Deforming meshes"). A tree that a shape has made much worse is built
// anew in a thread, above the same leaves, so that no picture depends on when that is done.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/scene/bvh_refit.hpp"
#include "daemon/core/scene/scene.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class Deformer {
 public:
  // Where a mesh lies in the scene's buffers. `bvh` gets the bounds and the grid of each shape.
  struct Place {
    scene::MeshBvh* bvh = nullptr;
    std::uint32_t first_record = 0, first_vertex = 0;
  };

  explicit Deformer(Device& device) : device_(device) {}

  // Builds the tree of a mesh that deforms, with room for a later one. Meshes are added in the
  // order of Scene::deformations; clear() forgets them all.
  void clear();
  scene::MeshBvh add(const scene::Scene& scene, const scene::Deformation& deformation);
  // Uploads what deforms the meshes that were added, which lie at these places. The pointers must
  // stay valid until the next clear().
  void upload(std::vector<Place> places);

  // Gives each mesh that was added its shape, in the scene's buffers. A mesh whose bounds would be
  // past what can be traced keeps the shape that it has. Returns the indices of those that changed.
  std::vector<std::size_t> deform(std::span<const scene::Shape> shapes, Buffer& bvh,
                                  const Buffer& vertices);
  // Returns whether the mesh that was added as number i has this shape.
  bool has_shape(std::size_t i, const scene::Shape& shape) const {
    return meshes_[i].shape == shape;
  }
  // Returns the shape that it has; none before the first deform().
  const std::optional<scene::Shape>& shape(std::size_t i) const { return meshes_[i].shape; }
  std::shared_ptr<const scene::DeformationReach> reach(std::size_t i) const {
    return meshes_[i].reach;
  }

  // Returns how many trees were built anew since clear().
  std::uint64_t rebuilt() const { return rebuilt_; }

 private:
  struct Mesh {
    std::shared_ptr<const scene::Undeformed> undeformed;
    std::vector<scene::DeformingPair> pairs;
    std::shared_ptr<const scene::DeformationReach> reach;
    scene::RefitPlan plan;
    Place place;
    gpu::GpuDeform push{};
    std::uint32_t room = 0;  // records that fit into its place
    std::uint32_t first_leaf = 0, first_node = 0, first_box = 0;
    double built_cost = 0;  // of its tree in the shape that it was built for
    std::optional<scene::Shape> shape;
    std::future<scene::RefittableBvh> better;
  };

  void upload_undeformed();
  void upload_plans();
  void upload_shapes();
  void take_better_trees(std::span<Mesh* const> meshes, Buffer& bvh);
  void record(const vk::raii::CommandBuffer& commands, Mesh& mesh, const Buffers& buffers);
  void watch_last();
  void watch(Mesh& mesh, const gpu::GpuRefitBox& root);

  Device& device_;
  std::vector<Mesh> meshes_;
  std::uint64_t rebuilt_ = 0;
  Kernel deform_, refit_leaves_, refit_nodes_;
  bool has_kernels_ = false;
  Buffer undeformed_, influences_, joints_, offsets_, weights_, leaves_, nodes_, boxes_, roots_;
  Downloads costs_down_;
  std::vector<gpu::GpuRefitBox> costs_;  // of the trees that were refitted last, once they are here
  std::vector<std::size_t> refitted_;    // their meshes
};

}  // namespace previz::render
