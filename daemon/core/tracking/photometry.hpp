// Converts frames of any format to grey: 8 bits to find tags in, exact luminance to measure them
// with.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/core/tracking/search_plan.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::tracking {

// Applies the sRGB transfer curve; `signal` is clipped to [0,1].
double srgb_encode(double signal);

// Inverts the camera's response. Holds no frame.
class Photometry {
 public:
  explicit Photometry(const ResponseCurve& response);

  // Returns the whole picture, or a part that lies in it, as sRGB-encoded luma of the linear
  // signal, row-major, width*height.
  std::vector<std::uint8_t> gray8(const Frame& frame) const;
  std::vector<std::uint8_t> gray8(const Frame& frame, const Region& part) const;

  // Returns the linear luminance (Rec. 709, white = 1) of one pixel. For yuv422p8 only the luma
  // sample is read, because chroma has half the resolution.
  double luminance(const Frame& frame, int x, int y) const;

 private:
  // Converts `pixels` pixels from pixel `first` on.
  void gray_row(const Frame& frame, std::size_t first, std::size_t pixels,
                std::uint8_t* gray) const;

  std::vector<double> signal8_;                           // by 8-bit sample
  std::vector<double> signal_luma_;                       // by 8-bit limited-range luma
  std::vector<double> signal16_;                          // by 16-bit sample
  std::vector<std::uint8_t> code8_, code_luma_, code16_;  // the same, sRGB-encoded
};

}  // namespace previz::tracking
