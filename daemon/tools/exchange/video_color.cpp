#include "daemon/tools/exchange/video_color.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "daemon/core/lighting/response.hpp"

namespace previz::exchange {

using lighting::d65, lighting::rec709;

namespace {

constexpr double most = 65535;

// H.273 table 3, value 16; SMPTE ST 2084: cd/m2.
double pq_light(double signal) {
  constexpr double m = 2523.0 / 4096 * 128, n = 2610.0 / 16384;
  constexpr double c1 = 3424.0 / 4096, c2 = 2413.0 / 4096 * 32, c3 = 2392.0 / 4096 * 32;
  const double power = std::pow(signal, 1 / m);
  return 10000 * std::pow(std::max(power - c1, 0.0) / (c2 - c3 * power), 1 / n);
}

// H.273 table 3, value 18; ARIB STD-B67.
double hlg_light(double signal) {
  constexpr double a = 0.17883277, b = 0.28466892, c = 0.55991073;
  return signal <= 0.5 ? signal * signal / 3 : (std::exp((signal - c) / a) + b) / 12;
}

constexpr std::array<double, 2> illuminant_c = {0.310, 0.316};

// H.273 table 2.
std::optional<Chromaticities> chromaticities_of(AVColorPrimaries primaries) {
  switch (primaries) {
    case AVCOL_PRI_UNSPECIFIED:
    case AVCOL_PRI_BT709:
      return rec709;
    case AVCOL_PRI_BT470M:
      return {{{{0.67, 0.33}, {0.21, 0.71}, {0.14, 0.08}, illuminant_c}}};
    case AVCOL_PRI_BT470BG:
      return {{{{0.64, 0.33}, {0.29, 0.60}, {0.15, 0.06}, d65}}};
    case AVCOL_PRI_SMPTE170M:
    case AVCOL_PRI_SMPTE240M:
      return {{{{0.630, 0.340}, {0.310, 0.595}, {0.155, 0.070}, d65}}};
    case AVCOL_PRI_FILM:
      return {{{{0.681, 0.319}, {0.243, 0.692}, {0.145, 0.049}, illuminant_c}}};
    case AVCOL_PRI_BT2020:
      return {{{{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, d65}}};
    case AVCOL_PRI_SMPTE428:
      return {{{{1, 0}, {0, 1}, {0, 0}, {1.0 / 3, 1.0 / 3}}}};
    case AVCOL_PRI_SMPTE431:
      return {{{{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.314, 0.351}}}};
    case AVCOL_PRI_SMPTE432:
      return {{{{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, d65}}};
    case AVCOL_PRI_EBU3213:
      return {{{{0.630, 0.340}, {0.295, 0.605}, {0.155, 0.077}, d65}}};
    default:
      return std::nullopt;
  }
}

}  // namespace

bool keeps_signal(AVColorTransferCharacteristic transfer) {
  switch (transfer) {
    case AVCOL_TRC_UNSPECIFIED:
    case AVCOL_TRC_BT709:
    case AVCOL_TRC_SMPTE170M:
    case AVCOL_TRC_SMPTE240M:
    case AVCOL_TRC_IEC61966_2_4:
    case AVCOL_TRC_BT1361_ECG:
    case AVCOL_TRC_IEC61966_2_1:
    case AVCOL_TRC_BT2020_10:
    case AVCOL_TRC_BT2020_12:
      return true;
    default:
      return false;
  }
}

std::optional<double> light_of(AVColorTransferCharacteristic transfer, double signal) {
  switch (transfer) {
    case AVCOL_TRC_GAMMA22:
      return std::pow(signal, 2.2);
    case AVCOL_TRC_GAMMA28:
      return std::pow(signal, 2.8);
    case AVCOL_TRC_LINEAR:
      return signal;
    case AVCOL_TRC_LOG:
      return signal > 0 ? std::pow(10, 2 * (signal - 1)) : 0;
    case AVCOL_TRC_LOG_SQRT:
      return signal > 0 ? std::pow(10, 2.5 * (signal - 1)) : 0;
    case AVCOL_TRC_SMPTE2084:
      return pq_light(signal) / pq_peak_cd_m2;
    case AVCOL_TRC_SMPTE428:
      return 52.37 / 48 * std::pow(signal, 2.6);
    case AVCOL_TRC_ARIB_STD_B67:
      return hlg_light(signal);
    default:
      return std::nullopt;
  }
}

std::optional<std::array<double, 9>> rec709_from(AVColorPrimaries primaries) {
  const auto from = chromaticities_of(primaries);
  if (!from) return std::nullopt;
  if (*from == rec709) return {{1, 0, 0, 0, 1, 0, 0, 0, 1}};
  return lighting::rec709_from(*from);
}

ColorConversion::ColorConversion(AVColorTransferCharacteristic transfer, AVColorPrimaries primaries,
                                 bool limited)
    : changes_transfer_(!keeps_signal(transfer)),
      changes_primaries_(chromaticities_of(primaries) != rec709),
      limited_(limited) {
  const auto matrix = rec709_from(primaries);
  std::ranges::copy(*matrix, matrix_.begin());
  if (!changes_anything()) return;
  constexpr double black = 16.0 / 255, range = 219.0 / 255;
  for (int i = 0; i <= most; ++i) {
    const double sample = i / most;
    const double signal = limited ? std::clamp((sample - black) / range, 0.0, 1.0) : sample;
    light_[0].push_back(
        static_cast<float>(changes_transfer_ ? *light_of(transfer, signal) : srgb_signal(signal)));
  }
  light_[1] = light_[2] = light_[0];
  fill_signals();
}

ColorConversion::ColorConversion(const ColorMeaning& meaning)
    : changes_transfer_(true), changes_primaries_(true), limited_(false) {
  std::ranges::copy(meaning.rec709, matrix_.begin());
  for (std::size_t c = 0; c < 3; ++c)
    for (int i = 0; i <= most; ++i)
      light_[c].push_back(static_cast<float>(meaning.light[c](i / most)));
  fill_signals();
  // Greys, and colours of all hues.
  constexpr int steps = 6, step = 65535 / (steps - 1);
  std::vector<std::uint16_t> samples;
  for (int i = 0; i < 256; ++i)
    samples.insert(samples.end(), 3, static_cast<std::uint16_t>(257 * i));
  for (int i = 0; i < steps * steps * steps; ++i)
    for (const int n : {i % steps, i / steps % steps, i / steps / steps})
      samples.push_back(static_cast<std::uint16_t>(n * step));
  std::vector<std::uint16_t> converted = samples;
  convert(converted);
  samples_ = clipped_ = 0;
  changes_transfer_ = changes_primaries_ =
      !std::ranges::equal(samples, converted, [](int a, int b) { return std::abs(a - b) <= 128; });
}

void ColorConversion::fill_signals() {
  const lighting::Response srgb({}, 16);
  for (int i = 0; i <= most; ++i) {
    const double sample = i / most;
    signal_.push_back(srgb.forward(sample * sample));
    gray_.push_back(srgb.forward(light_[1][static_cast<std::size_t>(i)]));
  }
}

void ColorConversion::convert(std::span<std::uint16_t> rgb) {
  // The light of half a step of 8 bits below black, and above white.
  constexpr float under = -0.5f / 255 / 12.92f, over = 1 + 0.5f / 255 * 2.2f;
  const auto& m = matrix_;
  for (std::size_t i = 0; i + 2 < rgb.size(); i += 3) {
    const float r = light_[0][rgb[i]], g = light_[1][rgb[i + 1]], b = light_[2][rgb[i + 2]];
    for (std::size_t c = 0; c < 3; ++c) {
      const float light = changes_primaries_ ? m[3 * c] * r + m[3 * c + 1] * g + m[3 * c + 2] * b
                                             : (c == 0   ? r
                                                : c == 1 ? g
                                                         : b);
      clipped_ += light < under || light > over;
      const float root = std::sqrt(light > 0 ? std::min(light, 1.0f) : 0);  // 0 for no number
      rgb[i + c] = signal_[static_cast<std::size_t>(std::lround(root * 65535))];
    }
  }
  samples_ += rgb.size() / 3 * 3;
}

double ColorConversion::clipped_share() const {
  return samples_ == 0 ? 0 : static_cast<double>(clipped_) / static_cast<double>(samples_);
}

std::string clipping_words(double share) {
  return fmt::format("{:.{}f} % of its samples are outside of what Rec. 709 holds, and are clipped",
                     100 * share, share < 0.1 ? 2 : 0);
}

}  // namespace previz::exchange
