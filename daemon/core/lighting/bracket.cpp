#include "daemon/core/lighting/bracket.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <tuple>

#include "daemon/core/lighting/response.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::lighting {
namespace {

std::string describe_frame(const Frame& frame) {
  return (frame.source.empty() ? "light" : frame.source) + " frame " +
         std::to_string(frame.sequence);
}

Codes make_codes(const Response& response, double dark_level) {
  Codes codes;
  codes.signal = response.inverse();
  const std::size_t count = codes.signal.size();
  codes.rounding_variance.resize(count);
  for (std::size_t v = 0; v < count; ++v) {
    const std::size_t below = v > 0 ? v - 1 : v, above = std::min(v + 1, count - 1);
    const double step =
        (codes.signal[above] - codes.signal[below]) / static_cast<double>(above - below);
    codes.rounding_variance[v] = step * step / 12;
  }
  codes.darkest = response.forward(dark_level);
  codes.dark = codes.signal[std::min(codes.darkest + 2, count - 1)] - codes.signal[codes.darkest];
  codes.clipped_from = response.clipping().at;
  codes.full = codes.signal[codes.clipped_from];
  for (double& signal : codes.signal) signal -= dark_level;
  codes.white = codes.signal[codes.clipped_from];
  if (!(codes.white > 0))
    throw Error("the light camera's clip_share counts signals from " + std::to_string(codes.full) +
                " on as clipped, and its dark_level is " + std::to_string(dark_level) +
                ", so that it would see no light; measure both again (previz calibrate response "
                "--camera light, previz calibrate sensor)");
  return codes;
}

void check_frame(const Frame& frame, const Frame& first) {
  if (!(frame.exposure > 0) || !std::isfinite(frame.exposure))
    throw Error(describe_frame(frame) + ": exposure is " + std::to_string(frame.exposure) +
                "; it must be above 0");
  if (frame.width != first.width || frame.height != first.height)
    throw Error(describe_frame(frame) + " has " + std::to_string(frame.width) + "x" +
                std::to_string(frame.height) + " pixels, the other exposures have " +
                std::to_string(first.width) + "x" + std::to_string(first.height));
}

// Returns log2 of the first exposure's radiance over the second's, for pixels that both see well.
std::vector<double> log_ratios(const Exposure& a, const Exposure& b, double read_noise) {
  constexpr std::size_t green = 1, most = 1 << 14;
  const auto radiance = [read_noise](const Exposure& e,
                                     std::size_t pixel) -> std::optional<double> {
    const Codes& codes = (*e.codes)[green];
    const std::uint16_t code = e.plate.samples[3 * pixel + green];
    const double signal = codes.signal[code];
    if (signal < std::max(4 * codes.dark, 10 * read_noise * codes.full) ||
        signal > 0.9 * codes.white)
      return std::nullopt;
    return signal / e.exposure;
  };
  const std::size_t pixels = a.plate.samples.size() / 3;
  std::vector<double> ratios;
  for (std::size_t p = 0; p < pixels; p += 1 + pixels / most) {
    const auto of_a = radiance(a, p), of_b = radiance(b, p);
    if (of_a && of_b) ratios.push_back(std::log2(*of_a / *of_b));
  }
  return ratios;
}

}  // namespace

Bracket::Bracket(std::span<const FramePtr> frames, const ResponseCurve& response,
                 const glm::dvec3& dark_level) {
  if (frames.empty()) throw Error("light: there is no frame to merge; at least one is needed");
  std::vector<FramePtr> newest_first(frames.rbegin(), frames.rend());
  std::stable_sort(
      newest_first.begin(), newest_first.end(), [](const FramePtr& a, const FramePtr& b) {
        return std::tie(a->timestamp_ns, a->sequence) > std::tie(b->timestamp_ns, b->sequence);
      });
  newest_ns_ = newest_first.front()->timestamp_ns;
  for (const FramePtr& frame : newest_first) {
    check_frame(*frame, *frames.front());
    Plate plate = to_plate(*frame);
    auto entry = codes_.find(plate.bits);
    if (entry == codes_.end()) {
      const Response curve(response, plate.bits);
      entry = codes_
                  .emplace(plate.bits, std::array{make_codes(curve, dark_level.r),
                                                  make_codes(curve, dark_level.g),
                                                  make_codes(curve, dark_level.b)})
                  .first;
    }
    exposures_.push_back({std::move(plate), frame->exposure, frame->sequence, &entry->second});
  }
}

std::vector<Disagreement> disagreements(const Bracket& bracket, const SensorNoise& noise) {
  constexpr std::size_t fewest = 64;
  std::vector<const Exposure*> sorted;
  for (const Exposure& exposure : bracket.exposures()) sorted.push_back(&exposure);
  std::sort(sorted.begin(), sorted.end(),
            [](const Exposure* a, const Exposure* b) { return a->exposure < b->exposure; });
  std::vector<Disagreement> found;
  for (std::size_t i = 0; i + 1 < sorted.size(); ++i) {
    std::vector<double> ratios = log_ratios(*sorted[i], *sorted[i + 1], noise.read_noise);
    if (ratios.size() < fewest) continue;
    std::sort(ratios.begin(), ratios.end());
    const double median = ratios[ratios.size() / 2];
    const double quartiles = ratios[3 * ratios.size() / 4] - ratios[ratios.size() / 4];
    if (std::abs(median) > 0.5 && quartiles < std::abs(median))
      found.push_back({sorted[i]->sequence, sorted[i + 1]->sequence, median});
  }
  return found;
}

}  // namespace previz::lighting
