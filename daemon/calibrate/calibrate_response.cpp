#include <fmt/ostream.h>

#include <cmath>

#include "daemon/calibrate/brackets.hpp"
#include "daemon/calibrate/calibrate.hpp"
#include "daemon/calibrate/report.hpp"
#include "daemon/calibrate/response_fit.hpp"
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
  write_tables(warn(doubts_of(best), out) + (of_light ? table<LightCameraCalibration>(best.curve)
                                                      : table<ObserverCalibration>(best.curve)),
               options.table_file, out);
}

}  // namespace previz::calibrate
