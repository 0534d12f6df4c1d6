// Converts the colours of a video or a still, by what its tags say of them, to the working space:
// linear Rec. 709 light in 0..1 under the sRGB curve.
#pragma once

extern "C" {
#include <libavutil/pixfmt.h>
}

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/lighting/primaries.hpp"

namespace previz::exchange {

// Returns the light of a signal 0..1 by the transfer characteristics of ITU-T H.273 table 3. Light
// of the scene where that table defines the signal by it (HLG, logarithmic), otherwise light of the
// display. 1 is the most that the signal can say, but 1000 cd/m2 for SMPTE ST 2084 (PQ), which
// reaches 10. Nothing for those that `keeps_signal`, and for unknown ones.
std::optional<double> light_of(AVColorTransferCharacteristic transfer, double signal);

// Light that the PQ curve counts as 1, cd/m2: the nominal peak of BT.2100's reference display.
inline constexpr double pq_peak_cd_m2 = 1000;

// Whether the signal is left as it is: no tag, sRGB, and the curves of cameras for television (BT.
// 601, 709, 2020 and their like), which displays show by the same curve as sRGB.
bool keeps_signal(AVColorTransferCharacteristic transfer);

// Returns the matrix, row-major, from linear RGB of the primaries (H.273 table 2) to linear Rec.
// 709, white to white (Bradford). Nothing for unknown primaries; the unit matrix for no tag.
std::optional<std::array<double, 9>> rec709_from(AVColorPrimaries primaries);

using lighting::Chromaticities, lighting::rec709_from;

// What a still's tags say of its samples: the light of a red, green and blue signal of 0..1, and
// the matrix, row-major, from that light to linear Rec. 709.
struct ColorMeaning {
  std::array<std::function<double(double)>, 3> light;
  std::array<double, 9> rec709;
};

// Converts pictures of RGB, 16 bits a sample.
class ColorConversion {
 public:
  // Both must be known. `limited`: the samples are from 16/255 to 235/255, as a capture of HDMI has
  // them; otherwise from 0 to 1.
  ColorConversion(AVColorTransferCharacteristic transfer, AVColorPrimaries primaries, bool limited);
  // One that moves no sample by half a step of 8 bits changes nothing.
  explicit ColorConversion(const ColorMeaning& meaning);

  bool changes_anything() const { return changes_transfer_ || changes_primaries_ || limited_; }
  // Samples in the order red, green, blue, as many as there are.
  void convert(std::span<std::uint16_t> rgb);
  // Returns the sample of one that has no colour.
  std::uint16_t gray(std::uint16_t sample) const {
    return changes_transfer_ || limited_ ? gray_[sample] : sample;
  }
  // Share of the samples so far that were outside of what Rec. 709 in 0..1 holds by more than half
  // a step of 8 bits, and have been clipped.
  double clipped_share() const;

 private:
  void fill_signals();

  bool changes_transfer_, changes_primaries_, limited_;
  std::array<float, 9> matrix_;
  std::array<std::vector<float>, 3> light_;  // of each sample of red, green and blue
  std::vector<std::uint16_t> signal_;        // of the square root of light, in 65535ths
  std::vector<std::uint16_t> gray_;          // the signal of each sample
  std::uint64_t samples_ = 0, clipped_ = 0;
};

// "4.21 % of its samples are outside of what Rec. 709 holds, and are clipped"
std::string clipping_words(double share);

}  // namespace previz::exchange
