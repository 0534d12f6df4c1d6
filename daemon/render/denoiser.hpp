// Takes noise out of a composite, guided by its own variance (P26): an edge-avoiding wavelet
// transform in Vulkan compute (shaders/denoise.comp).
//
// What is filtered is the one picture that is laid over the camera's: composite - (1 - M) Lc. So
// the two worlds never get different weights, what the camera saw keeps its sharpness, and where
// nothing virtual is near, the plate stays as it is, bit for bit. With more samples the variance
// falls, and with it what the filter blurs: it converges to the same picture.
#pragma once

#include <vector>

#include "daemon/render/composite.hpp"
#include "daemon/render/device.hpp"
#include "daemon/render/layers.hpp"

namespace previz::render {

class Denoiser {
 public:
  // About `most_pixels` are worked on at once, in bands of whole rows: 80 bytes of device memory
  // each.
  explicit Denoiser(Device& device, std::size_t most_pixels = std::size_t{1} << 21);

  // Changes composite and variance, which is then an estimate of the noise left; no other layer.
  // `camera`: the plate's radiance, interleaved RGB; empty: black. `rule`: by which the composite
  // was made; what ratio and hybrid multiply the plate by is filtered, and not the plate.
  //
  // What is brighter than the sensor's white counts as white, and as no surer than a few samples
  // would be: a lamp in a mirror, met by one sample of many, would else stay, or spread over all
  // its neighbours. A channel that comes out white still stays as bright as it was.
  //
  // Throws previz::Error where the device has no memory for it.
  void denoise(Layers& layers, const std::vector<double>& camera, const CompositeRule& rule = {});

 private:
  void resize(std::size_t pixels);
  void run(int width, int rows, bool single_sample);

  Device& device_;
  std::size_t most_pixels_;
  std::size_t pixels_ = 0;
  vk::raii::DescriptorSetLayout set_layout_{nullptr};
  vk::raii::PipelineLayout layout_{nullptr};
  vk::raii::DescriptorPool descriptors_{nullptr};
  vk::raii::DescriptorSets sets_{nullptr};  // set i reads signal and variance i, writes the others
  Pipeline variance_pass_, level_pass_;
  Buffer signal_[2], variance_[2], surface_;
};

}  // namespace previz::render
