#include "daemon/tools/calibrate/sensor/clip_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "daemon/core/lighting/response.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t clip_codes = 256, bins_per_stop = 4, light_bins = 30 * bins_per_stop;
constexpr int middle_code = 127;    // no set file counts it as clipped
constexpr int least_seen = 32;      // a code below it says too little about the light
constexpr int level_codes = 1;      // medians of one level differ by at most so much
constexpr int edge_px = 2;          // a demosaiced or halved colour reaches so far
constexpr double edge_light = 0.5;  // an edge is beside a pixel with less than this of its light
constexpr std::size_t least_samples_clipped = 100;
constexpr double below_lowest = 0.05;

using Histogram = std::array<std::size_t, clip_codes>;

std::size_t total(const Histogram& codes) {
  std::size_t sum = 0;
  for (const std::size_t count : codes) sum += count;
  return sum;
}

// Returns the highest code below which there is at most this share of the samples.
int quantile(const Histogram& codes, double share) {
  const double most = share * double(total(codes));
  std::size_t below = 0;
  for (std::size_t code = 0; code < clip_codes; ++code) {
    below += codes[code];
    if (double(below) > most) return int(code);
  }
  return clip_codes - 1;
}

// The light of each pixel of one channel, as a signal per exposure: 0 where the bracket shows it
// too dark, infinity where it shows it too bright to measure it.
class ChannelLight {
 public:
  ChannelLight(std::span<const BracketPicture> bracket, const lighting::Response& response,
               std::size_t channel)
      : width_(bracket[0].width), height_(bracket[0].height) {
    light_.resize(bracket[0].rgb.size() / 3);
    seen_in_.resize(light_.size());
    for (std::size_t p = 0; p < light_.size(); ++p) {
      std::size_t e = 0;
      while (e < bracket.size() && bracket[e].rgb[3 * p + channel] <= middle_code) ++e;
      light_[p] = std::numeric_limits<float>::infinity();
      if (e == 0) continue;
      const BracketPicture& last = bracket[e - 1];
      const int code = last.rgb[3 * p + channel];
      seen_in_[p] = std::uint16_t(e - 1);
      light_[p] =
          code < least_seen ? 0 : float(response.inverse()[std::size_t(code)] / last.exposure);
    }
  }

  int width() const { return width_; }
  int height() const { return height_; }
  float at(int x, int y) const { return light_[index(x, y)]; }
  std::size_t seen_in(int x, int y) const { return seen_in_[index(x, y)]; }

  bool is_edge(int x, int y) const {
    const double least = edge_light * at(x, y);
    return at(x - edge_px, y) < least || at(x + edge_px, y) < least || at(x, y - edge_px) < least ||
           at(x, y + edge_px) < least;
  }

 private:
  std::size_t index(int x, int y) const {
    return std::size_t(y) * std::size_t(width_) + std::size_t(x);
  }
  int width_, height_;
  std::vector<float> light_;
  std::vector<std::uint16_t> seen_in_;  // the exposure that light_ comes from
};

// Returns the codes of one channel by how much light its samples get, from the middle code's on.
std::vector<Histogram> codes_by_light(std::span<const BracketPicture> bracket,
                                      const lighting::Response& response, std::size_t channel) {
  const ChannelLight light(bracket, response, channel);
  const double from = response.inverse()[middle_code];
  std::vector<Histogram> bins(light_bins);
  for (int y = edge_px; y < light.height() - edge_px; ++y)
    for (int x = edge_px; x < light.width() - edge_px; ++x) {
      const double here = light.at(x, y);
      if (!(here > 0) || !std::isfinite(here) || light.is_edge(x, y)) continue;
      for (std::size_t e = light.seen_in(x, y) + 1; e < bracket.size(); ++e) {
        const double stops = std::log2(here * bracket[e].exposure / from);
        if (stops < 0) continue;
        const auto bin = std::min(std::size_t(stops * bins_per_stop), light_bins - 1);
        // A pixel that is dark although it was bright at less exposure has moved.
        const int code = bracket[e].rgb[3 * std::size_t(y * light.width() + x) + channel];
        if (code > middle_code) ++bins[bin][std::size_t(code)];
      }
    }
  return bins;
}

void add(Histogram& sum, const Histogram& codes) {
  for (std::size_t code = 0; code < clip_codes; ++code) sum[code] += codes[code];
}

// Returns the lowest bin from which on the codes do not rise any more; nothing if no bin has enough
// samples. A bin with too few has no say: ringing may move its median by several codes.
std::optional<std::size_t> first_of_level(const std::vector<Histogram>& bins) {
  std::optional<std::size_t> level;
  Histogram above{};
  for (std::size_t b = bins.size(); b-- > 0;) {
    if (total(bins[b]) >= least_samples_clipped) {
      const bool is_compared = total(above) >= least_samples_clipped;
      if (is_compared && std::abs(quantile(bins[b], 0.5) - quantile(above, 0.5)) > level_codes)
        break;
      level = b;
    }
    add(above, bins[b]);
  }
  return level;
}

ClippedChannel clipped_channel(const std::vector<Histogram>& bins) {
  const std::optional<std::size_t> level = first_of_level(bins);
  if (!level) return {};
  Histogram clipped{};
  std::size_t most = *level;
  // The level begins somewhere within its first bin.
  for (std::size_t b = *level + 1 + bins_per_stop; b < bins.size(); ++b) {
    add(clipped, bins[b]);
    if (total(bins[b]) > 0) most = b;
  }
  const std::size_t samples = total(clipped);
  if (samples < least_samples_clipped) return {};
  return {samples, quantile(clipped, 0.5), quantile(clipped, below_lowest),
          double(most - *level) / bins_per_stop};
}

}  // namespace

std::optional<int> ClipFit::code() const {
  std::optional<int> lowest;
  for (const ClippedChannel& channel : channels)
    if (channel.samples > 0) lowest = std::min(lowest.value_or(channel.lowest), channel.lowest);
  return lowest;
}

// Codes are the upper 8 bits of a deeper sample, so that code c begins at 256 c of 65535. Five
// digits are rounded down: of 8 bits, 255 times the result lies above c - 1 for every c.
std::optional<double> ClipFit::share() const {
  const std::optional<int> lowest = code();
  if (!lowest) return std::nullopt;
  return std::floor(*lowest / 256.0 * 1e5) / 1e5;
}

ClipFit fit_clip(std::span<const BracketPicture> bracket, const ResponseCurve& curve) {
  const lighting::Response response(curve, 8);
  ClipFit fit;
  for (std::size_t c = 0; c < 3; ++c)
    fit.channels[c] = clipped_channel(codes_by_light(bracket, response, c));
  for (const BracketPicture& picture : bracket)
    fit.brightest = std::max<int>(fit.brightest, std::ranges::max(picture.rgb));
  return fit;
}

std::string describe(const ClipFit& fit) {
  if (!fit.code())
    return fmt::format(
        "from which code on the camera clips was not measured (the highest code is {}): no area of "
        "the bracket gets clearly more light than the camera can show; add a picture of two stops "
        "more exposure than the longest, of a bright even area such as a white wall that the "
        "shortest shows no brighter than mid grey\n",
        fit.brightest);
  constexpr const char* names[] = {"red", "green", "blue"};
  std::string text = fmt::format(
      "the camera clips from code {} of 255 on: nineteen of twenty samples that get at least a "
      "stop more light than it can show have this code or a higher one\n",
      *fit.code());
  for (std::size_t c = 0; c < 3; ++c) {
    const ClippedChannel& channel = fit.channels[c];
    text +=
        channel.samples == 0
            ? fmt::format("  {}: too little of it is surely clipped\n", names[c])
            : fmt::format("  {}: from code {}, usually {}; {} samples, up to {:.1f} stops beyond\n",
                          names[c], channel.lowest, channel.usual, channel.samples,
                          channel.stops_further);
  }
  return text;
}

}  // namespace previz::calibrate
