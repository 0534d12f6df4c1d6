// The path tracer's passes: generate, then extend, shade and shadow once a segment, then
// accumulate. Paths are kept in compacted queues; a picture is worked on in tiles of whole rows.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "daemon/render/camera_map.hpp"
#include "daemon/render/device.hpp"
#include "daemon/render/photon_map.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class Wavefront {
 public:
  // `paths_a_slot`: 2, or 3 where FEATURE_CAMERA may be asked for.
  Wavefront(Device& device, int width, int height, std::uint32_t paths_a_slot);

  // Binds the scene's buffers (set 0, by binding) and makes sure that the pipelines are those for
  // `features`. Must be called whenever a buffer was recreated.
  void bind(const std::vector<const Buffer*>& scene, std::uint32_t features);
  // Photons a pass and the radius (metres) of the first, where `features` has FEATURE_PHOTONS.
  void use_photons(std::uint32_t count, double radius);
  std::uint32_t most_photons() const { return slots_; }
  // What the camera measured, row-major (CameraMap::upload), where `features` has FEATURE_CAMERA.
  void use_camera(const std::vector<glm::vec4>& plate);
  // How many samples the pixels of each block of SAMPLED_BLOCK^2 get at most, row-major.
  void limit_samples(const std::vector<std::uint32_t>& limits);
  // Forgets all samples; every pixel is sampled again, without a limit.
  void clear();
  // Adds samples first_sample .. first_sample + samples - 1 to every pixel, up to its limit.
  // Returns false where `cancelled` stopped it between two batches: the sums are then uneven and
  // must be cleared.
  bool render(std::uint32_t first_sample, std::uint32_t samples, std::uint32_t max_depth,
              const std::function<bool()>& cancelled);

  // What the picture's pixels have gathered, in tiles of whole rows from the top: GpuPixel[].
  struct Sums {
    const Buffer& pixels;
    int first_row, rows;
  };
  std::vector<Sums> sums() const;
  gpu::GpuControl control() const;  // counters since the last clear

 private:
  struct Tile {
    gpu::GpuBatch batch;      // its rectangle
    std::uint32_t limit = 0;  // the largest of its blocks'
    Buffer pixels;
    vk::raii::DescriptorSet set{nullptr};
  };

  void create_layouts();
  void create_tiles(int width, int height);
  void create_paths();
  void create_pipelines(std::uint32_t features);
  void write_path_set(const Tile& tile);
  void bind_sets(const vk::raii::CommandBuffer& commands, const Tile& tile,
                 const gpu::GpuBatch& batch) const;
  double share_of(std::uint32_t sample) const;
  bool render_with_photons(std::uint32_t first_sample, std::uint32_t samples,
                           std::uint32_t max_depth, const std::function<bool()>& cancelled);
  void record_extension(const vk::raii::CommandBuffer& commands) const;
  void record_photons(const vk::raii::CommandBuffer& commands, std::uint32_t max_depth) const;
  void record_batch(const vk::raii::CommandBuffer& commands, const Tile& tile,
                    const gpu::GpuBatch& batch, std::uint32_t max_depth) const;

  Device& device_;
  std::uint32_t max_slots_, paths_a_slot_;
  std::uint32_t slots_ = 0;  // allocated
  int width_, height_;
  PhotonMap photons_;
  CameraMap camera_;
  std::vector<std::uint32_t> sampled_until_;  // the limits of all blocks, least first
  double photon_radius_ = 0;                  // metres, of the first sample
  double traced_radius_ = 0;                  // and of the photons that there are
  double photons_owed_ = 0;                   // passes: at 1 they are traced anew
  vk::raii::DescriptorSetLayout scene_layout_{nullptr}, path_layout_{nullptr};
  vk::raii::PipelineLayout layout_{nullptr};
  vk::raii::DescriptorPool descriptors_{nullptr};
  vk::raii::DescriptorSet scene_set_{nullptr};
  std::vector<Tile> tiles_;
  std::uint32_t features_ = 0;
  Pipeline generate_, advance_, extend_, shade_, prepare_shadow_, shadow_, accumulate_;
  Buffer ray_origin_, ray_direction_, throughput_, hits_, queue_, shadow_rays_, sample_mixed_,
      sample_real_, sample_landed_, sample_aov_, limits_, control_;
};

}  // namespace previz::render
