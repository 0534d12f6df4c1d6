// Accumulates over time what is added to the camera's picture: the difference of the worlds on real
// surfaces and the radiance of virtual ones, each carried from frame to frame by its own motion
// (shaders/README.md, "Accumulation over time"). The plate is never part of it.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <limits>
#include <optional>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/passes/denoiser.hpp"
#include "daemon/core/render/world/gpu_environment.hpp"
#include "daemon/core/render/world/gpu_scene.hpp"
#include "daemon/core/render/world/light_change.hpp"
#include "daemon/core/render/world/moved_instances.hpp"
#include "drivers/calibration.hpp"

namespace previz::render {

// It takes 156 bytes of device memory per pixel, and 12 more where meshes deform.
class History {
 public:
  explicit History(Device& device);
  // Returns the passes of all its kernels.
  static std::vector<Pass> passes();

  // Forgets all frames so far.
  void forget();
  // Forgets the light so far, too: what follows is what it would be in a new object.
  void start_over();
  // Lets what was accumulated up to the next frame count as no more than this many frames: less
  // than one where it is no longer true.
  void shorten(double frames);
  // The light around the set, and its lamps, which shorten the past where they change.
  void light_with(const EncodedEnvironment& environment);
  void light_with(LightCells environment);
  void light_with(std::vector<set::Light> lamps);

  // What a frame is seen by.
  struct View {
    PinholeIntrinsics lens;
    glm::dmat4 world_from_camera{1.0};
    double white = 1;  // radiance at which the sensor clips
  };
  // Begins a frame. What was accumulated up to the last frame that was shown is then the past. It
  // counts less where instances that have moved since may have changed the light.
  void begin(const View& view, std::vector<GpuScene::Stance> stances);
  // Finds what each pixel of the frame shows. `scene` are the buffers of lib/scene.glsl with
  // "frame", "corner_rays"; a second call for the same number of samples does nothing.
  void find_surfaces(const Buffers& scene, std::uint32_t features, std::int64_t samples);
  // Records the passes that add the frame to its past, and that put the result in the place of what
  // composite.comp has made of a band. `constants` and `band_buffers` are present.comp's and
  // composite.comp's.
  void record(const vk::raii::CommandBuffer& commands, gpu::GpuShow constants, int width,
              const Denoiser::Band& band, Buffers band_buffers);

 private:
  struct Frame {
    View view;
    std::vector<GpuScene::Stance> stances;
    bool is_shown = false;
    std::size_t pixels = 0;  // that the buffers have room for
    Buffer places, things, lights, spreads, albedos, others, caustics;
    Buffer points;  // position and normal of each vertex that deforms
  };

  void reserve(Frame& frame);
  void keep_points(const vk::raii::CommandBuffer& commands, const Buffer& vertices);
  double frames_that_stay() const;
  std::vector<gpu::GpuMotion> motions() const;
  MovedInstances moved() const;
  gpu::GpuHistory constants(std::int64_t samples, const MovedInstances& moved) const;

  Device& device_;
  Kernel blend_, show_, surface_, cover_;
  std::optional<std::uint32_t> features_;  // of surface_, cover_ and blend_
  Frame frames_[2];
  int now_ = 0;                                                 // the other one is the past
  std::optional<std::int64_t> samples_;                         // for which the surfaces were found
  double shortened_ = std::numeric_limits<double>::infinity();  // for the next frame
  double shortened_now_ = std::numeric_limits<double>::infinity();  // for this one
  LightChange light_;
  Buffer covers_, befores_,
      bent_places_;  // of the current frame (shaders/history_cover.comp, history_surface.comp)
  Buffer history_, motions_, moves_, arrivals_;
};

}  // namespace previz::render
