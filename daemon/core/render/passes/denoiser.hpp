// Takes noise out of a composite with an edge-avoiding wavelet transform on the GPU: the more a
// pixel varies from sample to sample, the more of its neighbours it is averaged with (the paper's
// feature P26; shaders/README.md, "Denoising").
//
// Only what was added to the camera's picture is filtered: composite - (1 - M) Lc. Both worlds
// therefore get the same weights, the camera's picture keeps its sharpness, and where nothing
// virtual is near, the plate stays as it is, bit for bit. As samples are added, the variance falls,
// the filter blurs less, and the result converges to the same picture.
#pragma once

#include <span>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/picture/composite.hpp"
#include "daemon/core/render/picture/layers.hpp"
#include "daemon/core/render/picture/picture_memory.hpp"

namespace previz::render {

// Returns the largest variance that a change of this many samples is taken to have: no sample is
// counted as brighter than DENOISE_MOST_WHITES times `white`.
float most_variance(float white, std::int64_t samples);

class Denoiser {
 public:
  // Works on about `most_pixels` at once, in bands of whole rows, at 152 bytes of device memory per
  // pixel, 32 more with companions, and 32 more with the light of photons.
  explicit Denoiser(Device& device, std::size_t most_pixels = most_band_pixels);
  static std::span<const Pass> passes();  // of all its kernels

  // A band: given rows [top, bottom) as input, rows [first, last) of the output are right.
  struct Band {
    int first, last, top, bottom;
  };
  std::vector<Band> bands(int width, int height) const;
  // Makes the buffers large enough for this many pixels, which may replace them. With `companions`,
  // the following record() filters the change's uncovered part and mean(Lr) as well, which the
  // composite needs where the rule is not additive or the plate is clipped.
  // With `caustics` there is room for the light of photons, which record() filters by itself and
  // adds after the levels.
  void reserve(std::size_t pixels, bool companions, bool caustics = false);

  // The input buffers have one vec4 per pixel in the layout of shaders/lib/denoise.glsl, but for
  // the albedo, which has four halves; shaders/composite.comp fills them from the samples.
  //
  // A change of more than DENOISE_MOST_WHITES counts as that much, and its variance accordingly
  // (most_variance()). Otherwise the image of a lamp in a mirror, met by one sample of many,
  // would stay as a speck or spread over all its neighbours. A channel that is brighter than white
  // by more than two standard errors is a highlight and keeps its brightness.
  Buffer& signal() { return signal_[0]; }
  Buffer& variance() { return variance_[0]; }
  Buffer& surface() { return surface_; }
  Buffer& uncovered() { return uncovered_[0]; }
  Buffer& real() { return real_[0]; }
  Buffer& albedo() { return albedo_; }
  // The light of photons over white, without a division by the albedo, and its variance.
  Buffer& caustic() { return caustic_[0]; }
  // Records the passes over this many rows. `single_sample` says that pixels do not know their
  // variance; with `has_history` the variance has the number of each pixel's samples in its fourth
  // component, as shaders/history_show.comp leaves it.
  void record(const vk::raii::CommandBuffer& commands, int width, int rows, bool single_sample,
              bool has_history = false);
  // The buffers that hold the signal and its companions after the passes.
  const Buffer& denoised_signal() const;
  const Buffer& denoised_uncovered() const;
  const Buffer& denoised_real() const;

  // Reads the result of the passes over a band into the layers: replaces the composite and its
  // variance in the band's rows (the variance then estimates the noise left) and no other layer.
  // The layers' white must be finite. `plate` (empty: black) and `rule` are those that the
  // composite was made with.
  void read(const Band& band, Layers& layers, const PlateRadiance& plate,
            const CompositeRule& rule = {}) const;

 private:
  Device& device_;
  std::size_t most_pixels_;
  std::size_t pixels_ = 0;
  std::size_t companion_pixels_ = 0;  // that both sides of the companions have room for
  bool filters_companions_ = false;
  bool has_caustics_ = false;
  Kernel variance_pass_, guide_pass_, level_pass_, caustic_pass_, edge_pass_;
  // A pass reads one side and writes the other.
  Buffer signal_[2], variance_[2], uncovered_[2], real_[2];
  Buffer caustic_[2];
  Buffer surface_, albedo_, guide_;
};

}  // namespace previz::render
