#include <fmt/ostream.h>

#include <cmath>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/known_camera.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/calibrate/sensor/brackets.hpp"
#include "daemon/tools/calibrate/sensor/clip_fit.hpp"
#include "daemon/tools/calibrate/sensor/response_fit.hpp"

namespace previz::calibrate {
namespace {

// Returns words like "2", or "-" if too little of the picture could be compared.
std::string codes(double error) {
  return error < 0 ? "-" : fmt::format("{:g}", error);
}

void print_response(const ResponseFit& fit, std::ostream& out) {
  fmt::print(out,
             "{}: a held-out exposure is predicted to {:.2f} codes of 255 (mean of medians); the "
             "curve does not rise at {} of {} steps\n",
             to_string(fit.method), fit.error_codes, fit.flat_steps, fit.brightest - fit.darkest);
  for (const LeftOut& one : fit.left_out)
    fmt::print(out, "  {}: exposure {:g}, median error of red, green, blue: {} {} {}\n", one.name,
               one.exposure, codes(one.error_codes[0]), codes(one.error_codes[1]),
               codes(one.error_codes[2]));
}

template <typename Calibration>
std::string response_table(const ResponseCurve& curve) {
  Calibration calibration;
  calibration.response = curve;
  return set::response_toml(calibration);
}

std::string stream_of(CameraRole camera) {
  return camera == CameraRole::light ? "light" : "observer";
}

// Returns a line that compares the measured code with the threshold that is in use.
std::string compared(const ResponseCurve& curve, int measured, const ResponseOptions& options) {
  if (!is_session(options.footage))
    return "a clip_share in the set file stays in use until the table's replaces it\n";
  const double typed = response_of(options.footage, stream_of(options.camera)).clip_share;
  const char* const dark = options.camera == CameraRole::light
                               ? "lamps come out too dark"
                               : "shadows on them come out too dark";
  ResponseCurve in_use = curve;
  in_use.clip_share = typed;
  const int code = int(lighting::Response(in_use, 8).clipping().at);
  return fmt::format("the session has clip_share = {:g}, which counts codes from {} on", typed,
                     code) +
         (code == measured ? ": the same\n"
          : code > measured
              ? fmt::format(": pixels below it are clipped but pass for measured light, so that "
                            "{}; replace it by the table's\n",
                            dark)
              : ": pixels that still show light count as clipped; replace it by the table's\n");
}

// Returns the camera's table, under a comment with the evidence for clip_share. Where nothing was
// measured, the session's clip_share stays.
std::string table_of(ResponseCurve curve, const ClipFit& clip, const ResponseOptions& options,
                     std::ostream& out) {
  const auto table = [&] {
    return options.camera == CameraRole::light ? response_table<LightCameraCalibration>(curve)
                                               : response_table<ObserverCalibration>(curve);
  };
  curve.clip_share = response_of(options.footage, stream_of(options.camera)).clip_share;
  if (!clip.share()) {
    if (is_session(options.footage))
      fmt::print(out, "clip_share stays {:g}\n", curve.clip_share);
    else
      out << "the table has no clip_share; keep the one that the set file has\n";
    return table();
  }
  const std::string words = compared(curve, *clip.code(), options);
  out << words;
  curve.clip_share = *clip.share();
  return as_comment(describe(clip) + words) + table();
}

}  // namespace

void calibrate_response(const ResponseOptions& options, std::ostream& out) {
  const auto bracket = read_bracket(options.footage, stream_of(options.camera), options.exposures);
  fmt::print(out, "{} exposures, {:.1f} stops\n", bracket.size(),
             std::log2(bracket.back().exposure / bracket.front().exposure));
  std::vector<ResponseFit> fits;
  for (const ResponseMethod method : {ResponseMethod::debevec, ResponseMethod::robertson})
    if (!options.method || *options.method == method) {
      fits.push_back(fit_response(bracket, method));
      print_response(fits.back(), out);
    }
  const ResponseFit& best = better_fit(fits);
  fmt::print(out, "chosen: {}; codes {} to {} observed\n", to_string(best.method), best.darkest,
             best.brightest);
  const ClipFit clip = fit_clip(bracket, best.curve);
  out << describe(clip);
  const std::string doubts = warn(doubts_of(best, clip.code()), out);
  write_tables(doubts + table_of(best.curve, clip, options, out), options.table_file, out);
}

}  // namespace previz::calibrate
