// Keeps the lamps and the emissive triangles of a scene in GPU memory, with the tree over them.
// They are encoded anew only when something of them has changed; while nothing but the camera
// moves, only their places are uploaded, which are relative to it.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/world/bounds.hpp"
#include "daemon/core/render/world/gpu_lights.hpp"
#include "daemon/core/render/world/light_tree.hpp"
#include "daemon/core/scene/scene.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class SceneLights {
 public:
  explicit SceneLights(Device& device) : device_(device) {}

  // Finds the instances that emit, and how much each of their triangles does.
  void set_scene(const scene::Scene& scene);
  // Follows the mesh of an instance that emits and has changed its shape.
  void reshape(const scene::Scene& scene, std::uint32_t instance);
  // Returns the lamps that have a place and the objects that emit, without what is black. `spheres`
  // are those of the instances where they are now.
  std::vector<Shining> shining(const scene::Scene& scene, const Spheres& spheres,
                               const std::vector<set::Light>& lamps) const;
  // Uploads what has changed since the last call. `lamps`: those with an extent first,
  // and of these the distant ones; `lit_radius`: of the disc through which distant light reaches
  // what is lit, in metres.
  void place(const scene::Scene& scene, const std::vector<set::Light>& lamps, double lit_radius,
             const glm::dvec3& camera_position);

  // Returns the index of the first of an instance's lights; NO_INDEX if it does not emit.
  std::uint32_t first_light(std::size_t instance) const { return first_light_[instance]; }
  double power() const { return power_; }  // W per channel, mean of the channels
  // Returns how often lights were encoded since this object was made.
  std::uint64_t encoded() const { return encoded_; }

  // Fills the fields of the frame that describe the lights alone.
  void describe(gpu::GpuFrame& frame) const;
  void add_to(Buffers& buffers) const;

 private:
  struct Emitter {
    std::uint32_t instance;
    std::vector<double> weights;  // of emission_weights()
    LightShape shape;
    double power;  // W per channel in the object's own units, mean of the channels
  };
  // All that the encoded lights depend on.
  struct State {
    PlacedLights lamps;
    std::vector<glm::dmat4> places;  // of the emitters
    std::vector<std::uint32_t> presences;
    std::uint64_t shapes;
    double lit_radius;
  };

  static void shape(Emitter& emitter, const scene::Scene& scene);
  State state_of(const scene::Scene& scene, const std::vector<set::Light>& lamps,
                 double lit_radius) const;
  static bool are_equal(const State& a, const State& b);
  void encode(const scene::Scene& scene);
  void upload_positions(const glm::dvec3& camera_position);

  Device& device_;
  std::vector<Emitter> emitters_;           // in the order of their lights
  std::vector<std::uint32_t> first_light_;  // by instance
  std::uint64_t shapes_ = 0;
  std::uint64_t encoded_ = 0;
  std::optional<State> state_;  // that was encoded; empty: nothing yet
  std::vector<glm::dvec3> positions_;
  glm::dvec3 seen_from_{0.0};  // the camera's place of the last upload
  glm::dvec3 tree_origin_{0.0};
  std::uint32_t count_ = 0, visible_count_ = 0, distant_count_ = 0;
  float tree_share_ = 0;
  double power_ = 0, spread_ = 2;
  Buffer lights_, light_positions_, light_tree_;
};

}  // namespace previz::render
