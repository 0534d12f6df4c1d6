// The picture that is shown, made where the samples are: composite (P2), denoising (P26) and
// response (P5) on the device, so that of a live frame the plate goes up and the picture comes
// down, and nothing else. In single precision; the layers are made by daemon/render/composite.hpp
// in double.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "daemon/render/composite.hpp"
#include "daemon/render/denoiser.hpp"
#include "daemon/render/kernel.hpp"
#include "daemon/render/wavefront.hpp"

namespace previz::render {

// What it is made of.
struct ToPresent {
  std::vector<Wavefront::Sums> tiles;  // of all rows
  int width, height;
  const Plate& plate;  // of that size and the response's bits, or empty: over black
  double exposure;     // signal over radiance, above 0
  CompositeRule rule;
  std::int64_t samples;  // the most a pixel has
  bool denoise;
};

class Presenter {
 public:
  // For pictures with this response. Where nothing virtual touches a pixel, it is the plate's own
  // samples, bit for bit.
  Presenter(Device& device, const lighting::Response& response);

  // Band by band, 28 bytes of device memory a pixel beside the denoiser's. `after_band` is called
  // with each that the denoiser's passes have run over.
  Plate present(const ToPresent& what, Denoiser& denoiser,
                const std::function<void(const Denoiser::Band&)>& after_band = {});

 private:
  void reserve(std::size_t pixels);
  void composite(const ToPresent& what, const Denoiser::Band& band, gpu::GpuShow constants,
                 Denoiser& denoiser);

  Device& device_;
  int bits_;
  Kernel composite_, present_;
  std::size_t pixels_ = 0;
  Buffer signal_of_, least_of_, plate_, composites_, picture_;
};

}  // namespace previz::render
