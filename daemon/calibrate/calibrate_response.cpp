#include <fmt/ostream.h>

#include <cmath>

#include "daemon/calibrate/brackets.hpp"
#include "daemon/calibrate/calibrate.hpp"
#include "daemon/calibrate/clip_fit.hpp"
#include "daemon/calibrate/known_camera.hpp"
#include "daemon/calibrate/report.hpp"
#include "daemon/calibrate/response_fit.hpp"
#include "daemon/calibrate/source.hpp"
#include "daemon/lighting/response.hpp"
#include "daemon/set/print.hpp"

namespace previz::calibrate {
namespace {

// Returns words like "2", or "-" if too little of the picture could be compared.
std::string codes(double error) {
  return error < 0 ? "-" : fmt::format("{:g}", error);
}

void print_response(const ResponseFit& fit, std::ostream& out) {
  fmt::print(out,
             "{}: an exposure left out is predicted to {:.2f} codes of 255 (mean of medians); the "
             "curve does not rise at {} of {} steps\n",
             to_string(fit.method), fit.error_codes, fit.flat_steps, fit.brightest - fit.darkest);
  for (const LeftOut& one : fit.left_out)
    fmt::print(out, "  {}: exposure {:g}, median error of red, green, blue: {} {} {}\n", one.name,
               one.exposure, codes(one.error_codes[0]), codes(one.error_codes[1]),
               codes(one.error_codes[2]));
}

template <typename Calibration>
std::string table(const ResponseCurve& curve) {
  Calibration calibration;
  calibration.response = curve;
  return set::response_toml(calibration);
}

// Returns a line that compares the measured code with the threshold that is in use.
std::string compared(const ResponseCurve& curve, int measured, const ResponseOptions& options) {
  if (!is_session(options.footage))
    return "a clip_share in the set file stays in use until the table's replaces it\n";
  const double typed = response_of(options.footage, "observer").clip_share;
  ResponseCurve in_use = curve;
  in_use.clip_share = typed;
  const int code = int(lighting::Response(in_use, 8).clipping().at);
  return fmt::format(
      "the session has clip_share = {:g}, which counts codes from {} on{}\n", typed, code,
      code == measured  ? ": the same"
      : code > measured ? ": pixels below it are clipped but pass for measured light, so that "
                          "shadows on them come out too dark; replace it by the table's"
                        : ": pixels that still show light count as clipped; replace it by the "
                          "table's");
}

// Returns the film camera's table, under a comment with the evidence for clip_share. Where nothing
// was measured, the session's clip_share stays.
std::string observer_table(ResponseCurve curve, const ClipFit& clip, const ResponseOptions& options,
                           std::ostream& out) {
  curve.clip_share = response_of(options.footage, "observer").clip_share;
  if (!clip.share()) {
    fmt::print(out, "clip_share stays {:g}\n", curve.clip_share);
    return table<ObserverCalibration>(curve);
  }
  const std::string words = compared(curve, *clip.code(), options);
  out << words;
  curve.clip_share = *clip.share();
  return as_comment(describe(clip) + words) + table<ObserverCalibration>(curve);
}

// The light camera has no clip_share: only the largest code counts as clipped there.
std::vector<std::string> light_clip_doubts(const ClipFit& clip) {
  const int code = clip.code().value_or(255);
  if (code == 255) return {};
  return {fmt::format(
      "the light camera clips from code {} of 255 on, but only code 255 counts as clipped there, "
      "so that its brightest lamps come out too dark; let the camera deliver full range and "
      "uncompressed pictures",
      code)};
}

}  // namespace

void calibrate_response(const ResponseOptions& options, std::ostream& out) {
  const bool of_light = options.camera == CameraRole::light;
  const auto bracket =
      read_bracket(options.footage, of_light ? "light" : "observer", options.exposures);
  fmt::print(out, "{} exposures, {:.1f} stops\n", bracket.size(),
             std::log2(bracket.back().exposure / bracket.front().exposure));
  std::vector<ResponseFit> fits;
  for (const ResponseMethod method : {ResponseMethod::debevec, ResponseMethod::robertson})
    if (!options.method || *options.method == method) {
      fits.push_back(fit_response(bracket, method));
      print_response(fits.back(), out);
    }
  const ResponseFit& best = better_fit(fits);
  fmt::print(out, "taken: {}; codes {} to {} were seen\n", to_string(best.method), best.darkest,
             best.brightest);
  const ClipFit clip = fit_clip(bracket, best.curve);
  out << describe(clip);
  std::string tables;
  if (of_light) {
    tables = warn(doubts_of(best), out) + warn(light_clip_doubts(clip), out) +
             table<LightCameraCalibration>(best.curve);
  } else {
    tables =
        warn(doubts_of(best, clip.code()), out) + observer_table(best.curve, clip, options, out);
  }
  write_tables(tables, options.table_file, out);
}

}  // namespace previz::calibrate
