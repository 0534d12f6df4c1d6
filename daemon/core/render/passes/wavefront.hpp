// Adds samples to a picture: runs the path tracer one segment at a time for all paths at once. One
// pass generates camera rays, then for each segment one finds what the rays hit, one shades it and
// one traces the shadow rays, and a last one adds up (shaders/README.md, "The passes"). A picture
// is worked on in tiles of whole rows, and paths that have ended leave the queues.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/passes/camera_map.hpp"
#include "daemon/core/render/passes/photon_map.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class Wavefront {
 public:
  // A slot is the place of one sample of one pixel; its path forks where the worlds part. So
  // `paths_a_slot` is 2, or 3 where FEATURE_CAMERA may be asked for, which forks once more.
  Wavefront(Device& device, int width, int height, std::uint32_t paths_a_slot);

  // Makes room for a picture of another size; the next samples are to be preceded by a clear().
  // Kernels stay, and so do buffers: only a picture that is larger than all before it gets new
  // ones.
  void resize(int width, int height);
  std::uint32_t paths_a_slot() const { return paths_a_slot_; }
  // Returns the passes that use_scene() makes kernels of for these features, on a device with these
  // DEVICE_* bits.
  static std::vector<Pass> passes_for(std::uint32_t features, std::uint32_t device);

  // Uses the scene in these buffers, which must stay where they are, and the pipelines for
  // `features`.
  void use_scene(Buffers scene, std::uint32_t features);
  // Sets the photons per pass and the radius of the first pass, over the distance from the camera;
  // used where `features` has FEATURE_PHOTONS.
  void use_photons(std::uint32_t count, double radius);
  std::uint32_t most_photons() const { return most_photons_; }
  // Takes the scene's plate as the camera's measurement, each code of which stands for this linear
  // radiance; used where `features` has FEATURE_CAMERA.
  void use_camera(const std::vector<float>& radiance_of_codes);
  // Limits the number of samples for the pixels of each of the SAMPLED_PARTS of each block of
  // SAMPLED_BLOCK^2: blocks are row-major, and so are the parts of one.
  void limit_samples(const std::vector<std::uint32_t>& limits);
  // Forgets all samples; every pixel is sampled again, without a limit.
  void clear();
  // Sets the sums to zero. Limits, photons and what was counted stay, so that samples can go on.
  void clear_sums();
  // Adds samples first_sample .. first_sample + samples - 1 to every pixel, up to its limit.
  // Returns false where `cancelled` stopped it between two batches: the sums are then uneven and
  // must be cleared.
  bool render(std::uint32_t first_sample, std::uint32_t samples, std::uint32_t max_depth,
              const std::function<bool()>& cancelled);

  // The sums of the picture's pixels so far, in tiles of whole rows from the top: GpuPixel[].
  struct Sums {
    const Buffer& pixels;
    int first_row, rows;
    // vec4[]: the sum of what photons bring to the change (shaders/README.md, "Denoising"); null:
    // there are no photons.
    const Buffer* caustics = nullptr;
  };
  std::vector<Sums> sums() const;
  // Returns the same in the computer's memory.
  PixelSums keep() const;
  // Puts kept sums in the place of the picture's, of which they must have the size; with the
  // features that they were kept with. The next samples are to be preceded by a clear().
  void put_back(const PixelSums& kept);
  gpu::GpuControl control();                                 // counters since the last clear
  const Buffer& control_buffer() const { return control_; }  // what is shown is counted there, too
  // The same as they are now, by a copy that comes down.
  void count_into(gpu::GpuControl& counted, Downloads& down) const;

 private:
  struct Tile {
    gpu::GpuBatch batch;      // the tile's rectangle
    std::uint32_t limit = 0;  // the largest limit in its blocks
  };

  Purpose for_paths() const;
  void create_tiles();
  void create_paths();
  void create_path_buffers(std::uint32_t slots);
  void create_caustics(bool has_photons);
  void create_kernels(std::uint32_t features);
  void record_clear_sums(const vk::raii::CommandBuffer& commands);
  Buffers buffers_of(std::size_t tile) const;  // with the scene's and the maps'
  vk::DeviceSize bytes_of(const Tile& tile) const;
  std::uint32_t passes() const;  // rounds for panes that paths meet and pass
  double share_of(std::uint32_t sample) const;
  bool render_with_photons(std::uint32_t first_sample, std::uint32_t samples,
                           std::uint32_t max_depth, const std::function<bool()>& cancelled);
  void count();
  void record_extension(const Recording& recording);
  void record_photons(const vk::raii::CommandBuffer& commands, const gpu::GpuBatch& batch,
                      const Buffers& buffers, std::uint32_t max_depth);
  void record_batch(const Recording& recording, const gpu::GpuBatch& batch,
                    std::uint32_t max_depth);

  Device& device_;
  std::uint32_t max_slots_, paths_a_slot_;
  std::uint32_t slots_ = 0;  // allocated
  std::uint32_t most_photons_ = 0;
  int width_ = 0, height_ = 0;
  PhotonMap photons_;
  CameraMap camera_;
  std::vector<std::uint32_t> sampled_until_;  // the limits, sorted, least first
  double photon_radius_ = 0;                  // over the distance; of the first sample
  double traced_radius_ = 0;                  // likewise; of the current photons
  double photons_owed_ = 0;                   // passes; photons are traced anew at 1
  Buffers scene_;
  std::vector<Tile> tiles_;
  std::vector<Buffer> pixels_;    // of the tiles; those of smaller pictures may use a part of them
  std::vector<Buffer> caustics_;  // likewise
  std::optional<std::uint32_t> features_;  // of the kernels, once they are made
  Kernel generate_, advance_, extend_, prepare_shadow_, shadow_, accumulate_;
  std::vector<Kernel> shade_;  // one after the other
  Buffer ray_origin_, ray_direction_, throughput_, receivers_, hits_, queue_, shadow_rays_,
      sample_mixed_, sample_real_, sample_landed_, sample_aov_, sample_albedo_, sample_caustic_,
      limits_, control_;
  gpu::GpuControl counted_{};  // what control_ was after the last samples, once it is here
  Downloads counted_down_;
};

}  // namespace previz::render
