#include "daemon/core/lighting/hdr.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/core/lighting/parallel.hpp"

namespace previz::lighting {
namespace {

constexpr double confidence = 5;  // standard deviations

double variance_of(double signal, const Codes& codes, std::uint16_t code,
                   const SensorNoise& noise) {
  const double signal_per_electron = noise.signal_per_electron * codes.full;
  const double read_noise = noise.read_noise * codes.full;
  return std::max(signal, 0.0) * signal_per_electron + read_noise * read_noise +
         codes.rounding_variance[code];
}

// Returns 1 well inside the range of codes, falling to 0 at white, where noise would clip some
// samples and not others.
double trust(double signal, const Codes& codes) {
  if (signal < codes.dark) return 0;
  return std::clamp((codes.white - signal) / (0.08 * codes.full), 0.0, 1.0);
}

// The evidence about one channel of a pixel, from a single exposure or summed over several that
// agree.
struct Evidence {
  double signals = 0, open = 0;   // sums of signals and exposures, over exposures not clipped
  double variance = 0, dark = 0;  // of `signals`
  double at_least = 0;            // least radiance that clips every exposure that is clipped

  void add(const Evidence& other) {
    signals += other.signals;
    open += other.open;
    variance += other.variance;
    dark = std::max(dark, other.dark);
    at_least = std::max(at_least, other.at_least);
  }
  double radiance() const { return signals / open; }
};

Evidence evidence_of(const Exposure& e, std::size_t sample, std::size_t channel,
                     const SensorNoise& noise) {
  const Codes& codes = (*e.codes)[channel];
  const std::uint16_t code = e.plate.samples[sample];
  if (codes.clipped(code)) return {0, 0, 0, 0, codes.white / e.exposure};
  const double signal = codes.signal[code];
  return {signal, e.exposure, variance_of(signal, codes, code, noise), codes.dark, 0};
}

bool beyond(double excess, double variance) {
  return excess > 0 && excess * excess > confidence * confidence * variance;
}

bool contradict(const Evidence& a, const Evidence& b, const SensorNoise& noise) {
  // Returns whether the radiance in `low` lies significantly below `high`, the least radiance that
  // clips the other evidence.
  const auto below = [&](const Evidence& low, double high) {
    const double gap = high * (1 - noise.calibration_error) - low.radiance() - low.dark / low.open;
    return beyond(gap, low.variance / (low.open * low.open));
  };
  if (a.open > 0 && b.at_least > 0 && below(a, b.at_least)) return true;
  if (b.open > 0 && a.at_least > 0 && below(b, a.at_least)) return true;
  if (a.open == 0 || b.open == 0) return false;
  const double high = std::max({a.radiance(), b.radiance(), 0.0});
  const double excess = std::abs(a.radiance() - b.radiance()) - a.dark / a.open - b.dark / b.open -
                        noise.calibration_error * high;
  return beyond(excess, a.variance / (a.open * a.open) + b.variance / (b.open * b.open));
}

struct Channel {
  double radiance = 0;
  double variance = 0;
  bool clipped = false;
  bool black = false;
};

class PixelMerger {
 public:
  PixelMerger(const std::vector<Exposure>& exposures, const SensorNoise& noise)
      : exposures_(exposures), noise_(noise), agree_(exposures.size()) {}

  // Returns whether every exposure agrees with the newer ones about the pixel. Those that agree are
  // used from now on.
  bool select(std::size_t pixel) {
    std::array<Evidence, 3> newer{};
    bool all = true;
    for (std::size_t e = 0; e < exposures_.size(); ++e) {
      std::array<Evidence, 3> said{};
      bool agrees = true;
      for (std::size_t c = 0; c < 3; ++c) {
        said[c] = evidence_of(exposures_[e], 3 * pixel + c, c, noise_);
        agrees = agrees && !contradict(newer[c], said[c], noise_);
      }
      agree_[e] = agrees;
      all = all && agrees;
      if (agrees)
        for (std::size_t c = 0; c < 3; ++c) newer[c].add(said[c]);
    }
    seen_ = newer;
    return all;
  }

  Channel channel(std::size_t pixel, std::size_t c) const {
    const Evidence& seen = seen_[c];
    if (seen.open == 0) return {seen.at_least, 0, true, false};
    const double first = seen.radiance();
    double sum = 0, weights = 0;
    bool black = true;
    for (std::size_t i = 0; i < exposures_.size(); ++i) {
      if (!agree_[i]) continue;
      const Exposure& e = exposures_[i];
      const Codes& codes = (*e.codes)[c];
      const std::uint16_t code = e.plate.samples[3 * pixel + c];
      black = black && codes.black(code);
      if (codes.clipped(code)) continue;
      const double expected = first * e.exposure;
      const double weight = trust(expected, codes) * e.exposure * e.exposure /
                            variance_of(expected, codes, code, noise_);
      sum += weight * codes.signal[code] / e.exposure;
      weights += weight;
    }
    if (black) return {0, seen.variance / (seen.open * seen.open), false, true};
    const double radiance = std::max(0.0, weights > 0 ? sum / weights : first);
    // This evidence is too noisy to contradict a newer exposure that is clipped, and no better than
    // it.
    if (radiance < seen.at_least * (1 - noise_.calibration_error))
      return {seen.at_least, 0, true, false};
    return {radiance, weights > 0 ? 1 / weights : seen.variance / (seen.open * seen.open), false,
            false};
  }

 private:
  const std::vector<Exposure>& exposures_;
  const SensorNoise& noise_;
  std::vector<bool> agree_;         // by exposure
  std::array<Evidence, 3> seen_{};  // of the exposures that agree
};

}  // namespace

HdrPicture merge(const Bracket& bracket, const SensorNoise& noise) {
  HdrPicture picture;
  picture.width = bracket.width();
  picture.height = bracket.height();
  const std::size_t width = static_cast<std::size_t>(picture.width);
  const std::size_t pixels = width * static_cast<std::size_t>(picture.height);
  picture.radiance.resize(pixels);
  picture.variance.resize(pixels);
  picture.flags.resize(pixels);
  parallel_blocks(picture.height, [&](int begin, int end) {
    PixelMerger merger(bracket.exposures(), noise);
    for (std::size_t p = width * static_cast<std::size_t>(begin);
         p < width * static_cast<std::size_t>(end); ++p) {
      std::uint8_t flags = merger.select(p) ? 0 : moved;
      bool black = true;
      for (int c = 0; c < 3; ++c) {
        const Channel channel = merger.channel(p, static_cast<std::size_t>(c));
        picture.radiance[p][c] = static_cast<float>(channel.radiance);
        picture.variance[p][c] = static_cast<float>(channel.variance);
        if (channel.clipped) flags |= overexposed;
        black = black && channel.black;
      }
      picture.flags[p] = black ? flags | underexposed : flags;
    }
  });
  return picture;
}

}  // namespace previz::lighting
