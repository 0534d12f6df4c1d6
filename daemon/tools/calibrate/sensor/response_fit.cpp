#include "daemon/tools/calibrate/sensor/response_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/photo.hpp>

#include "daemon/core/lighting/response.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t code_count = 256;
constexpr std::size_t most_pixels = 4000, least_samples = 100;
constexpr int debevec_side = 10;
constexpr float debevec_smoothness = 10, robertson_threshold = 0.01f;
constexpr int robertson_rounds = 50;
constexpr int noise_codes = 4;  // a longer exposure may be darker by so much
constexpr int dark_end = 15, bright_end = 240;
constexpr std::size_t least_predicted = 50;

// Holds the codes of the chosen pixels: that of exposure e, pixel p, channel c is at [e][3 p + c].
using Samples = std::vector<std::vector<std::uint8_t>>;

bool rises(std::span<const BracketPicture> bracket, std::size_t sample) {
  for (std::size_t e = 1; e < bracket.size(); ++e)
    if (bracket[e].rgb[sample] + noise_codes < bracket[e - 1].rgb[sample]) return false;
  return true;
}

// Returns whether a sample is neither black nor white in at least two exposures.
bool is_seen(std::span<const BracketPicture> bracket, std::size_t sample) {
  return std::ranges::count_if(bracket, [&](const BracketPicture& picture) {
           return picture.rgb[sample] >= dark_end && picture.rgb[sample] <= bright_end;
         }) >= 2;
}

// Chooses up to `count` of the pixels, as many dark as bright ones: most of a picture has one
// brightness, but the curve is needed for all.
std::vector<std::size_t> spread(std::span<const BracketPicture> bracket,
                                const std::vector<std::size_t>& pixels, std::size_t count) {
  std::vector<std::vector<std::size_t>> by_brightness(32);
  for (const std::size_t p : pixels) {
    std::size_t sum = 0;
    for (const BracketPicture& picture : bracket)
      for (std::size_t c = 0; c < 3; ++c) sum += picture.rgb[3 * p + c];
    by_brightness[sum * by_brightness.size() / (bracket.size() * 3 * code_count)].push_back(p);
  }
  // Within a brightness, pixels are spread evenly over the picture; a brightness with few pixels
  // uses all of them.
  std::ranges::sort(by_brightness, {}, [](const auto& some) { return some.size(); });
  std::vector<std::size_t> chosen;
  for (std::size_t b = 0; b < by_brightness.size(); ++b) {
    const auto& some = by_brightness[b];
    const std::size_t share = (count - chosen.size()) / (by_brightness.size() - b);
    const std::size_t taken = std::min(share, some.size());
    for (std::size_t i = 0; i < taken; ++i) chosen.push_back(some[i * some.size() / taken]);
  }
  return chosen;
}

Samples choose(std::span<const BracketPicture> bracket) {
  std::vector<std::size_t> usable;
  const std::size_t pixels = bracket[0].rgb.size() / 3;
  for (std::size_t p = 0; p < pixels; ++p) {
    bool use = true;
    for (std::size_t c = 0; c < 3; ++c)
      use = use && rises(bracket, 3 * p + c) && is_seen(bracket, 3 * p + c);
    if (use) usable.push_back(p);
  }
  if (usable.size() < least_samples)
    throw Error("only " + std::to_string(usable.size()) +
                " pixels brighten with exposure and are usable in two pictures; did the camera "
                "and the scene stay still, and are the given exposures right?");
  Samples samples(bracket.size());
  for (const std::size_t p : spread(bracket, usable, most_pixels))
    for (std::size_t e = 0; e < bracket.size(); ++e)
      for (std::size_t c = 0; c < 3; ++c) samples[e].push_back(bracket[e].rgb[3 * p + c]);
  return samples;
}

// Interpolates codes that no exposure showed (0 in OpenCV's answer) between their neighbours; below
// the first code they are in proportion to it. White stands for everything brighter: its signal,
// the least that clips, is extrapolated from the codes below it.
void complete(std::vector<double>& signal) {
  constexpr std::size_t white = code_count - 1, run = 8;
  std::size_t last = 0;
  for (std::size_t v = 1; v < white; ++v) {
    if (!(signal[v] > 0)) continue;
    const double below = last ? signal[last] : 0;
    for (std::size_t gap = last + 1; gap < v; ++gap)
      signal[gap] = below + (signal[v] - below) * double(gap - last) / double(v - last);
    last = v;
  }
  const std::size_t from = last > run ? last - run : 0;
  const double slope = std::max(0.0, signal[last] - (from ? signal[from] : 0)) /
                       double(std::max<std::size_t>(1, last - from));
  for (std::size_t v = last + 1; v <= white; ++v)
    signal[v] = signal[last] + slope * double(v - last);
}

// Returns the relative signal by code, fitted by OpenCV to all exposures but one (or to all, if
// `without` is no index).
std::vector<double> solve(const Samples& samples, std::span<const BracketPicture> bracket,
                          ResponseMethod method, std::size_t without) {
  std::vector<cv::Mat> pictures;
  std::vector<float> times;
  for (std::size_t e = 0; e < samples.size(); ++e) {
    if (e == without) continue;
    pictures.push_back(
        cv::Mat(int(samples[e].size()), 1, CV_8UC1, const_cast<std::uint8_t*>(samples[e].data())));
    times.push_back(float(bracket[e].exposure));
  }
  cv::Mat response;
  if (method == ResponseMethod::debevec) {
    // OpenCV picks its samples on a grid, so it gets a picture that consists of that grid.
    for (cv::Mat& picture : pictures) {
      cv::Mat1b grid(debevec_side, debevec_side);
      for (int i = 0; i < int(grid.total()); ++i)
        grid(i / debevec_side, i % debevec_side) =
            picture.at<std::uint8_t>(int(std::size_t(i) * samples[0].size() / grid.total()));
      picture = grid;
    }
    cv::createCalibrateDebevec(debevec_side * debevec_side, debevec_smoothness)
        ->process(pictures, response, times);
  } else {
    // OpenCV 4.6 assumes that there are three channels.
    for (cv::Mat& picture : pictures) cv::merge(std::vector<cv::Mat>(3, picture), picture);
    cv::createCalibrateRobertson(robertson_rounds, robertson_threshold)
        ->process(pictures, response, times);
  }
  std::vector<double> signal(code_count);
  cv::extractChannel(response, response, 0);
  for (std::size_t v = 0; v < code_count; ++v) signal[v] = response.at<float>(int(v));
  complete(signal);
  return signal;
}

LeftOut predict(const Samples& samples, std::span<const BracketPicture> bracket,
                const ResponseCurve& curve, std::size_t left_out) {
  const lighting::Response response(curve, 8);
  LeftOut result{bracket[left_out].name, bracket[left_out].exposure, {}};
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<int> errors;
    for (std::size_t s = c; s < samples[0].size(); s += 3) {
      const int seen = samples[left_out][s];
      if (seen < dark_end || seen > bright_end) continue;
      // The predicted radiance comes from codes that are neither near black nor near white.
      double signals = 0, open = 0;
      for (std::size_t e = 0; e < samples.size(); ++e) {
        const std::uint8_t code = samples[e][s];
        if (e == left_out || code < dark_end || code > bright_end) continue;
        signals += response.inverse()[code];
        open += bracket[e].exposure;
      }
      if (open == 0) continue;
      const double predicted = signals / open * bracket[left_out].exposure;
      errors.push_back(std::abs(response.forward(predicted) - seen));
    }
    result.error_codes[c] = -1;
    if (errors.size() < least_predicted) continue;
    const auto middle = errors.begin() + std::ptrdiff_t(errors.size() / 2);
    std::ranges::nth_element(errors, middle);
    result.error_codes[c] = *middle;
  }
  return result;
}

// Counts the steps of less than 1e-5 of the signal: a smooth curve of 256 codes over 10 stops rises
// by a hundredth a step, and monotone_curve sets values that were equal 1e-7 apart.
int flat_steps(const ResponseCurve& curve, int darkest, int brightest) {
  constexpr double least_rise = 1e-5;
  int flat = 0;
  for (int code = darkest; code < brightest; ++code) {
    const double here = curve.inverse_table[std::size_t(code)];
    if (curve.inverse_table[std::size_t(code) + 1] < here * (1 + least_rise)) ++flat;
  }
  return flat;
}

double mean_error(const std::vector<LeftOut>& all) {
  double sum = 0;
  int count = 0;
  for (const LeftOut& one : all)
    for (const double error : one.error_codes)
      if (error >= 0) {
        sum += error;
        ++count;
      }
  return count ? sum / count : 0;
}

}  // namespace

const char* to_string(ResponseMethod method) {
  return method == ResponseMethod::debevec ? "Debevec" : "Robertson";
}

ResponseCurve monotone_curve(std::vector<double> signal) {
  // This is pool adjacent violators (Barlow et al. 1972) over the logarithms of codes 1 to 255.
  struct Pool {
    double sum;
    int count;
    double mean() const { return sum / count; }
  };
  std::vector<Pool> pools;
  for (std::size_t v = 1; v < signal.size(); ++v) {
    pools.push_back({std::log(std::max(signal[v], 1e-12)), 1});
    while (pools.size() > 1 && pools[pools.size() - 2].mean() >= pools.back().mean()) {
      const Pool last = pools.back();
      pools.pop_back();
      pools.back() = {pools.back().sum + last.sum, pools.back().count + last.count};
    }
  }
  ResponseCurve curve;
  curve.kind = ResponseCurve::Kind::table;
  curve.inverse_table = {0};
  // Codes of one pool differ by a step that nobody sees but that survives printing.
  constexpr double step = 1e-7;
  for (const Pool& pool : pools)
    for (int i = 0; i < pool.count; ++i)
      curve.inverse_table.push_back(
          std::max(std::exp(pool.mean()), curve.inverse_table.back() * (1 + step)));
  const double white = curve.inverse_table.back();
  for (double& value : curve.inverse_table) value /= white;
  curve.inverse_table.back() = 1;
  return curve;
}

ResponseFit fit_response(std::span<const BracketPicture> bracket, ResponseMethod method) {
  const Samples samples = choose(bracket);
  ResponseFit fit;
  fit.method = method;
  fit.curve = monotone_curve(solve(samples, bracket, method, bracket.size()));
  for (std::size_t e = 0; e < bracket.size(); ++e) {
    const ResponseCurve others = monotone_curve(solve(samples, bracket, method, e));
    fit.left_out.push_back(predict(samples, bracket, others, e));
  }
  fit.error_codes = mean_error(fit.left_out);
  fit.darkest = 255;
  for (const auto& picture : samples)
    for (const std::uint8_t code : picture) {
      if (code > 0) fit.darkest = std::min<int>(fit.darkest, code);
      if (code < 255) fit.brightest = std::max<int>(fit.brightest, code);
    }
  fit.flat_steps = flat_steps(fit.curve, fit.darkest, fit.brightest);
  return fit;
}

std::vector<std::string> doubts_of(const ResponseFit& fit, std::optional<int> clips_from) {
  constexpr double certain_codes = 5, jump = 3;
  constexpr std::size_t step = 5, dark_codes = 32;
  std::vector<std::string> doubts;
  if (fit.error_codes > certain_codes)
    doubts.push_back(fmt::format(
        "a held-out exposure is predicted only to {:.1f} codes: the light changed, something "
        "moved, or the camera changed more than the time (its aperture, gain or white balance was "
        "automatic, or it sharpens and lifts shadows)",
        fit.error_codes));
  const std::vector<double>& curve = fit.curve.inverse_table;
  for (std::size_t code = dark_codes; code + step < curve.size(); ++code) {
    if (curve[code + step] <= jump * curve[code]) continue;
    const char* const cause =
        clips_from
            ? "clipped light shows at these codes too, so that codes from about {0} on are guesses "
              "and white is too bright; take a bracket with darker pictures of what is brightest, "
              "or rely on the table's clip_share, which counts codes from {2} on as clipped"
            : "the camera probably clips its light at about code {0}, so that all brighter codes "
              "are guesses and white is too bright; take a bracket with darker pictures of what is "
              "brightest, or give clip_share = {1:.2f} beside the table";
    doubts.push_back(
        fmt::format("the curve jumps from {:.3f} at code {} to {:.3f} at code {}: ", curve[code],
                    code, curve[code + step], code + step) +
        fmt::format(fmt::runtime(cause), code, double(code) / 255, clips_from.value_or(255)));
    break;
  }
  return doubts;
}

const ResponseFit& better_fit(std::span<const ResponseFit> fits) {
  return *std::ranges::min_element(fits, {}, [](const ResponseFit& fit) {
    const double steps = std::max(1, fit.brightest - fit.darkest);
    return fit.error_codes * (1 + fit.flat_steps / steps);
  });
}

}  // namespace previz::calibrate
