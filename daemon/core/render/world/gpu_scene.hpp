// Keeps the scene in GPU memory: data that lasts as long as the scene, and data that is placed anew
// for each camera position, because GPU space is relative to the camera (subtracted in double
// precision).
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/world/bounds.hpp"
#include "daemon/core/render/world/deformer.hpp"
#include "daemon/core/render/world/feature.hpp"
#include "daemon/core/render/world/gpu_environment.hpp"
#include "daemon/core/render/world/ray_structures.hpp"
#include "daemon/core/render/world/scene_lights.hpp"
#include "daemon/core/scene/bvh.hpp"
#include "daemon/core/scene/scene.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class GpuScene {
 public:
  explicit GpuScene(Device& device)
      : device_(device), deformer_(device), structures_(device), lights_(device) {}

  // Counts what was built or uploaded since this object was made.
  struct Work {
    std::uint64_t trees = 0;  // of meshes, but for those that deforming takes
    std::uint64_t materials = 0, textures = 0;
  };

  // Builds the meshes' BVHs and uploads everything that does not depend on the camera. What is
  // equal to what the scene before had, of trees with their vertices and of textures, stays where
  // it is. Surfaces are perfect mirrors where their GGX alpha is at most `specular_alpha`; with
  // `filters_textures` there are levels of textures.
  void set_scene(const scene::Scene& scene, double specular_alpha, bool filters_textures);
  void set_environment(const EncodedEnvironment& encoded, set::LightSampling sampling);
  // Puts the same meshes at other places, with other looks of theirs (scene::Variants), under other
  // lamps. Only the top level is rebuilt, by the next place(); emissive triangles are found anew if
  // what glows has changed. The number of instances must stay the same.
  void move(const std::vector<scene::Instance>& instances, const std::vector<set::Light>& lights);
  // Gives the meshes that deform their shapes, those of Scene::deformations in their order. The
  // meshes stay in the shape at rest until the first call.
  void deform(const std::vector<scene::Shape>& shapes);
  const Work& work() const { return work_; }
  // Returns how many trees of meshes that deform were built anew since these meshes were set.
  std::uint64_t rebuilt_trees() const { return deformer_.rebuilt(); }
  // Returns how often the lights were encoded.
  std::uint64_t encoded_lights() const { return lights_.encoded(); }
  // Sets lamps beside the scene's own, which may change from frame to frame; absent: there are
  // never any.
  void set_sources(std::optional<std::vector<set::Light>> sources);
  // The shape of a mesh that deforms, and where its vertices lie among all.
  struct Deformed {
    std::optional<scene::Shape> shape;  // none: that at rest
    std::shared_ptr<const scene::DeformationReach> reach;
    std::uint32_t first_vertex = 0, vertices = 0;
    friend bool operator==(const Deformed&, const Deformed&) = default;
  };
  // An instance as far as what is seen on it can be followed from frame to frame.
  struct Stance {
    glm::dmat4 world_from_object{1.0};
    glm::vec3 low{0}, high{0};  // box around it, object space; empty where low > high
    std::uint32_t material = 0, presence = 0;
    std::optional<Deformed> deformed = {};
    bool may_be_dirac = false;  // it may reflect or refract without blur
    bool emits = false;
    friend bool operator==(const Stance&, const Stance&) = default;
  };
  std::vector<Stance> stances() const;
  // What move(), deform() and set_sources() have made of the scene.
  struct Standing {
    std::vector<scene::Instance> instances;
    std::vector<set::Light> lights;
    std::vector<scene::Shape> shapes;
    std::optional<std::vector<set::Light>> sources;
  };
  Standing standing() const { return {scene_.instances, scene_.lights, shapes_, sources_}; }
  // Puts the same scene back to where it stood; place() is to follow.
  void stand(const Standing& standing);
  // Returns the lamps of the scene and the sources beside them.
  std::vector<set::Light> lamps() const;
  // Uploads instances, top level and lights relative to `camera_position` (world, metres).
  void place(const glm::dvec3& camera_position);

  // Returns what the scene and the environment ask for; valid once placed. The result refers to
  // this scene and to `estimation`, so it must not outlive them.
  Demand demand(const set::Estimation& estimation) const;
  // Fills the fields of the frame that describe environment and lights. `features`: FEATURE_* bits.
  void describe(gpu::GpuFrame& frame, std::uint32_t features) const;
  // Returns the buffers that the shaders read, except the frame and its rays, which the renderer
  // has.
  Buffers buffers() const;

 private:
  struct MeshPlace {     // where a mesh lies in the shared buffers
    scene::MeshBvh bvh;  // its texels moved into the shared buffer
    std::uint32_t first_record = 0;
    std::uint32_t first_triangle = 0;
    std::uint32_t first_vertex = 0;
    std::uint32_t first_extra = 0;
  };

  void upload_meshes();
  void upload_tree(const std::vector<glm::uvec4>& bvh);
  void build_structures();
  void check_deforming() const;
  void upload_materials(double specular_alpha);
  scene::Material as_read(const scene::Material& material) const;
  void upload_textures();
  void find_bounds(const Spheres& spheres);
  bool shape_emitter(std::size_t deformation);
  void find_extent();
  void upload_instances(const glm::dvec3& camera_position);
  void place_structures(const std::vector<scene::TopInstance>& top);
  void upload_bounds(const glm::dvec3& camera_position);

  Device& device_;
  bool has_scene_ = false;
  Work work_;
  scene::Scene scene_;
  double specular_alpha_ = 0;
  bool filters_textures_ = false;
  MaterialFeatures material_features_;
  bool may_glow_ = false;                           // some instance does, or would in a variant
  std::vector<scene::Instance> instances_as_set_;   // as set_scene() got them
  std::vector<scene::Shape> shapes_;                // as deform() got them last
  std::vector<bool> may_be_dirac_;                  // each material
  Spheres spheres_;                                 // of instances_as_set_
  Spheres placed_spheres_;                          // of the instances where they are now
  std::optional<std::vector<set::Light>> sources_;  // absent: there are never any
  std::vector<MeshPlace> places_;
  Deformer deformer_;
  RayStructures structures_;  // where rays are traced in hardware
  SceneLights lights_;
  Bounds difference_bounds_, specular_bounds_;
  glm::dvec3 scene_center_{0.0};  // of the instances' bounds; world, metres
  glm::dvec3 seen_from_{0.0};     // the camera's place of the last place()
  double scene_radius_ = 1;
  double lit_radius_ = 1;  // of what is lit, as lit_radius() says
  std::uint32_t environment_size_ = 1, environment_levels_ = 0;
  double environment_mean_ = 0, environment_spread_ = 2;
  set::LightSampling sampling_ = set::LightSampling::importance;

  Buffer bvh_, vertices_, triangles_, extras_, texels_, environment_, importance_, albedo_,
      instances_, materials_, textures_, bounds_buffer_;
};

}  // namespace previz::render
