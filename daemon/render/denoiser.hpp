// Takes noise out of a composite with an edge-avoiding wavelet transform on the GPU: the more a
// pixel varies from sample to sample, the more of its neighbours it is averaged with (the paper's
// feature P26; shaders/README.md, "Denoising").
//
// Only what was added to the camera's picture is filtered: composite - (1 - M) Lc. Both worlds
// therefore get the same weights, the camera's picture keeps its sharpness, and where nothing
// virtual is near, the plate stays as it is, bit for bit. As samples are added, the variance falls,
// the filter blurs less, and the result converges to the same picture.
#pragma once

#include <vector>

#include "daemon/render/composite.hpp"
#include "daemon/render/kernel.hpp"
#include "daemon/render/layers.hpp"
#include "daemon/render/picture_memory.hpp"

namespace previz::render {

// Returns the least variance that is assumed of a composite of this many samples where it is
// brighter than `white`: the variance of a few samples, however alike they were.
float most_sure_variance(float white, std::int64_t samples);

class Denoiser {
 public:
  // Works on about `most_pixels` at once, in bands of whole rows, at 80 bytes of device memory per
  // pixel.
  explicit Denoiser(Device& device, std::size_t most_pixels = most_band_pixels);

  // A band: given rows [top, bottom) as input, rows [first, last) of the output are right.
  struct Band {
    int first, last, top, bottom;
  };
  std::vector<Band> bands(int width, int height) const;
  // Makes the buffers large enough for this many pixels, which may replace them.
  void reserve(std::size_t pixels);

  // The input buffers have one vec4 per pixel in the layout of shaders/lib/denoise.glsl;
  // shaders/composite.comp fills them from the samples.
  //
  // Radiance brighter than the sensor's white counts as white, and as no more certain than a few
  // samples would be (most_sure_variance()). Otherwise the image of a lamp in a mirror, met by one
  // sample of many, would stay as a speck or spread over all its neighbours. A channel that comes
  // out white keeps its original brightness.
  Buffer& signal() { return signal_[0]; }
  Buffer& variance() { return variance_[0]; }
  Buffer& surface() { return surface_; }
  // Records the passes over this many rows. `single_sample` says that pixels do not know their
  // variance.
  void record(const vk::raii::CommandBuffer& commands, int width, int rows, bool single_sample);
  // The buffer that holds the signal after the passes.
  const Buffer& denoised_signal() const;

  // Reads the result of the passes over a band into the layers: replaces the composite and its
  // variance in the band's rows (the variance then estimates the noise left) and no other layer.
  // The layers' white must be finite. `camera` is the plate's radiance, interleaved RGB (empty:
  // black). `rule` is the rule the composite was made by: with ratio and hybrid the factor of the
  // plate is filtered, and not the plate.
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
