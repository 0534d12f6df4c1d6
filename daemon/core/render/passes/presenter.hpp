// Makes the picture that is shown where the samples are: composite (P2), denoising (P26) and
// response (P5) run on the device, so that for a live frame only the plate goes up and only the
// picture comes down. It works in single precision; daemon/core/render/picture/composite.hpp makes
// the layers in double.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "daemon/core/render/device/code_tables.hpp"
#include "daemon/core/render/device/kernel.hpp"
#include "daemon/core/render/passes/denoiser.hpp"
#include "daemon/core/render/passes/history.hpp"
#include "daemon/core/render/passes/wavefront.hpp"
#include "daemon/core/render/picture/composite.hpp"

namespace previz::render {

// The input of a shown picture.
struct ToPresent {
  std::vector<Wavefront::Sums> tiles;  // cover all rows
  int width, height;
  const Buffer& control;  // GpuControl, which counts
  const Buffer& plate;    // codes of the response's bits as shaders/lib/plate.glsl reads them
  bool has_plate;         // if not, the composite is over black
  bool is_clipped;        // some code of the plate may be from response.clipping().from on
  double exposure;        // signal over radiance, above 0
  CompositeRule rule;
  std::int64_t samples;  // the largest number that a pixel has
  bool denoise;
  bool dither = false;         // the picture is to be looked at, and its codes may be off by one
  History* history = nullptr;  // what the frame is added to; null: it stands alone
  // The camera's whole picture, and its size, onto which a smaller rendering is put; null: the
  // picture has the size of the rendering.
  const Buffer* whole = nullptr;
  int whole_width = 0, whole_height = 0;

  void put_onto(const Buffer& plate_codes, const Frame& camera) {
    whole = &plate_codes;
    whole_width = camera.width;
    whole_height = camera.height;
  }
  int shown_width() const { return whole ? whole_width : width; }
  int shown_height() const { return whole ? whole_height : height; }
};

// Says where a finished picture goes.
struct Destination {
  Downloads& down;
  Plate* plate = nullptr;  // of the right size; its samples are there only once `down` is finished
  vk::Image on_card;       // null: not there (daemon/core/render/device/card_pictures.hpp)
};

class Presenter {
 public:
  // Makes pictures with this response. Where nothing virtual touches a pixel, the result is the
  // plate's own samples, bit for bit.
  Presenter(Device& device, const lighting::Response& response);
  static std::span<const Pass> passes();  // of all its kernels

  const CodeTables& tables() const { return tables_; }
  // Works band by band, with 30 bytes of device memory per pixel beside the denoiser's, and 32 per
  // pixel of a rendering that is put onto a whole picture.
  // `after_band` is called with each band that the denoiser's passes have run over.
  Plate present(const ToPresent& what, Denoiser& denoiser,
                const std::function<void(const Denoiser::Band&)>& after_band = {});
  // The same, without waiting for it.
  void present_later(const ToPresent& what, Denoiser& denoiser, const Destination& to,
                     const std::function<void(const Denoiser::Band&)>& after_band = {});
  // Adds a frame to its history, which it must have, and makes no picture.
  void add_to_history(const ToPresent& what, Denoiser& denoiser);
  // Replaces the composite and the mask in the band's rows by those that present() has made of the
  // samples before they are denoised, with the history if there is one; from `after_band` only.
  void read(const Denoiser::Band& band, Layers& layers) const;

 private:
  struct Rows {  // of the shown picture
    int first, last;
    bool are_last;
  };

  gpu::GpuShow start(const ToPresent& what, const Denoiser::Band& band, Denoiser& denoiser);
  void reserve(std::size_t pixels);
  void composite(const ToPresent& what, const Denoiser::Band& band, gpu::GpuShow constants,
                 Denoiser& denoiser);
  void reserve_shown(std::size_t pixels);
  void reserve_additions(const ToPresent& what);
  void enlarge(const ToPresent& what, const Destination& to);
  void hand_over(int width, const Rows& rows, const Destination& to);
  void scan_out(int width, const Rows& shown, vk::Image image);
  void accumulate(const ToPresent& what, const Denoiser::Band& band, const gpu::GpuShow& constants,
                  Denoiser& denoiser);

  Device& device_;
  int bits_;
  lighting::Clipping clipping_;
  Kernel composite_, present_, sides_, enlarge_, scan_out_;
  std::size_t pixels_ = 0, shown_pixels_ = 0;
  CodeTables tables_;
  Buffer thresholds_, composites_, highlights_, additions_, sides_of_, picture_, screen_;
};

}  // namespace previz::render
