#include "daemon/lighting/hdr.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "daemon/lighting/parallel.hpp"
#include "daemon/lighting/response.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

std::string describe(const Frame& frame) {
  return (frame.source.empty() ? "light" : frame.source) + " frame " +
         std::to_string(frame.sequence);
}

// What a code of a frame says: the signal, and the variance that is in it for not knowing the
// signal better than the code. The same for all frames of a bit depth.
struct Codes {
  std::vector<double> signal;
  std::vector<double> rounding_variance;
  double dark = 0;  // signal below which rounding to black or to its neighbour rules
};

Codes make_codes(const ResponseCurve& response, int bits) {
  Codes codes;
  codes.signal = Response(response, bits).inverse();
  const std::size_t count = codes.signal.size();
  codes.rounding_variance.resize(count);
  for (std::size_t v = 0; v < count; ++v) {
    const std::size_t below = v > 0 ? v - 1 : v, above = std::min(v + 1, count - 1);
    const double step =
        (codes.signal[above] - codes.signal[below]) / static_cast<double>(above - below);
    codes.rounding_variance[v] = step * step / 12;
  }
  codes.dark = codes.signal[std::min<std::size_t>(2, count - 1)];
  return codes;
}

struct Exposure {
  Plate plate;
  double exposure = 0;
  const Codes* codes = nullptr;
};

// 1 well inside the range of codes, falling to 0 at white, where noise would clip some samples and
// not others.
double trust(double signal, double dark) {
  if (signal < dark) return 0;
  return std::clamp((1 - signal) / 0.08, 0.0, 1.0);
}

struct Channel {
  double radiance = 0;
  bool clipped = false;
  bool black = false;
};

Channel merge_channel(std::span<const Exposure> exposures, std::size_t sample,
                      const SensorNoise& noise) {
  double signals = 0, open = 0;
  double shortest = exposures.front().exposure;
  bool black = true;
  for (const Exposure& e : exposures) {
    const std::uint16_t code = e.plate.samples[sample];
    shortest = std::min(shortest, e.exposure);
    black = black && code == 0;
    if (code + 1u == e.codes->signal.size()) continue;
    signals += e.codes->signal[code];
    open += e.exposure;
  }
  if (open == 0) return {1 / shortest, true, false};
  if (black) return {0, false, true};

  const double first = signals / open;
  double sum = 0, weights = 0;
  for (const Exposure& e : exposures) {
    const std::uint16_t code = e.plate.samples[sample];
    if (code + 1u == e.codes->signal.size()) continue;
    const double expected = first * e.exposure;
    const double variance = expected * noise.signal_per_electron +
                            noise.read_noise * noise.read_noise + e.codes->rounding_variance[code];
    const double weight = trust(expected, e.codes->dark) * e.exposure * e.exposure / variance;
    sum += weight * e.codes->signal[code] / e.exposure;
    weights += weight;
  }
  return {weights > 0 ? sum / weights : first, false, false};
}

}  // namespace

HdrPicture merge_exposures(std::span<const FramePtr> frames, const ResponseCurve& response,
                           const SensorNoise& noise) {
  if (frames.empty()) throw Error("light: there is no frame to merge; at least one is needed");
  HdrPicture picture;
  picture.width = frames.front()->width;
  picture.height = frames.front()->height;

  std::map<int, Codes> codes;  // by bit depth
  std::vector<Exposure> exposures;
  for (const FramePtr& frame : frames) {
    if (!(frame->exposure > 0) || !std::isfinite(frame->exposure))
      throw Error(describe(*frame) + ": exposure is " + std::to_string(frame->exposure) +
                  "; it must be above 0");
    if (frame->width != picture.width || frame->height != picture.height)
      throw Error(describe(*frame) + " has " + std::to_string(frame->width) + "x" +
                  std::to_string(frame->height) + " pixels, the other exposures have " +
                  std::to_string(picture.width) + "x" + std::to_string(picture.height));
    Plate plate = to_plate(*frame);
    auto entry = codes.find(plate.bits);
    if (entry == codes.end())
      entry = codes.emplace(plate.bits, make_codes(response, plate.bits)).first;
    exposures.push_back({std::move(plate), frame->exposure, &entry->second});
  }

  const std::size_t width = static_cast<std::size_t>(picture.width);
  picture.radiance.resize(width * static_cast<std::size_t>(picture.height));
  picture.flags.resize(picture.radiance.size());
  parallel_blocks(picture.height, [&](int begin, int end) {
    for (std::size_t p = width * static_cast<std::size_t>(begin);
         p < width * static_cast<std::size_t>(end); ++p) {
      bool clipped = false, black = true;
      for (int c = 0; c < 3; ++c) {
        const Channel channel =
            merge_channel(exposures, 3 * p + static_cast<std::size_t>(c), noise);
        picture.radiance[p][c] = static_cast<float>(channel.radiance);
        clipped = clipped || channel.clipped;
        black = black && channel.black;
      }
      picture.flags[p] =
          static_cast<std::uint8_t>((clipped ? overexposed : 0) | (black ? underexposed : 0));
    }
  });
  return picture;
}

long exposure_step(double exposure) {
  return std::lround(std::log(exposure) / std::log1p(0.01));
}

}  // namespace previz::lighting
