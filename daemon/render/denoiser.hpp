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
#include "daemon/render/kernel.hpp"
#include "daemon/render/layers.hpp"
#include "daemon/render/picture_memory.hpp"

namespace previz::render {

// The most variance that a composite of so many samples is taken to have.
float most_sure_variance(float white, std::int64_t samples);

class Denoiser {
 public:
  // About `most_pixels` are worked on at once, in bands of whole rows: 80 bytes of device memory
  // each.
  explicit Denoiser(Device& device, std::size_t most_pixels = most_band_pixels);

  // Rows [first, last) come out right where rows [top, bottom) go in.
  struct Band {
    int first, last, top, bottom;
  };
  std::vector<Band> bands(int width, int height) const;
  // Makes the buffers large enough for so many pixels; they may then be others.
  void reserve(std::size_t pixels);

  // What goes in, a vec4 a pixel, as shaders/lib/denoise.glsl has it. shaders/composite.comp makes
  // it of what was sampled.
  //
  // What is brighter than the sensor's white counts as white, and as no surer than a few samples
  // would be (most_sure_variance()): a lamp in a mirror, met by one sample of many, would else
  // stay, or spread over all its neighbours. A channel that comes out white still stays as bright
  // as it was.
  Buffer& signal() { return signal_[0]; }
  Buffer& variance() { return variance_[0]; }
  Buffer& surface() { return surface_; }
  // The passes over so many rows. `single_sample`: pixels do not know their variance.
  void record(const vk::raii::CommandBuffer& commands, int width, int rows, bool single_sample);
  // Where the signal is then.
  const Buffer& denoised_signal() const;

  // Once they have run over a band of the layers' picture: changes composite and variance of its
  // rows, which is then an estimate of the noise left; no other layer. Their white must be finite.
  // `camera`: the plate's
  // radiance, interleaved RGB; empty: black. `rule`: by which the composite was made; what ratio
  // and hybrid multiply the plate by is filtered, and not the plate.
  void read(const Band& band, Layers& layers, const std::vector<double>& camera,
            const CompositeRule& rule = {}) const;

 private:
  Device& device_;
  std::size_t most_pixels_;
  std::size_t pixels_ = 0;
  Kernel variance_pass_, level_pass_;
  Buffer signal_[2], variance_[2], surface_;  // a pass reads one side and writes the other
};

}  // namespace previz::render
