// Fits the camera's response curve to a bracket of exposures.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/sensor/brackets.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

enum class ResponseMethod { debevec, robertson };
const char* to_string(ResponseMethod method);

// Cross-validation: how well the curve from the other exposures predicts one that was left out.
struct LeftOut {
  std::string name;
  double exposure = 0;
  // The median of |predicted - seen| over the pixels seen as 15 to 240, in codes (of 255), by
  // channel; negative if there are fewer than 50 such pixels.
  double error_codes[3] = {-1, -1, -1};
};

struct ResponseFit {
  ResponseMethod method = ResponseMethod::debevec;
  ResponseCurve curve;  // a table of 256 entries
  std::vector<LeftOut> left_out;
  double error_codes = 0;          // mean of left_out's medians
  int darkest = 0, brightest = 0;  // codes seen; beyond them the curve is only smooth
  int flat_steps = 0;  // from one of these codes to the next, at which the curve does not rise
};

// Fits one curve for the three channels, whose scales (the white balance) a bracket cannot
// determine: channels enter as pixels of their own. The fit uses up to 4000 pixels, as many dark as
// bright ones, whose value does not fall as the exposure grows (which leaves out whatever moved or
// is no picture):
//   debevec    Debevec and Malik 1997 (cv::createCalibrateDebevec), over 100 samples of them
//   robertson  Robertson, Borman and Stevenson 1999 (cv::createCalibrateRobertson), over all
// The curve is then made to increase (isotonic regression of the logarithm: pool adjacent
// violators) and scaled to run from 0 at code 0 to 1 at code 255. `bracket` is as read_bracket
// returns it. Throws previz::Error if fewer than 100 pixels can be used.
ResponseFit fit_response(std::span<const BracketPicture> bracket, ResponseMethod method);

// Returns what a curve may be doubted for, and the likely cause; empty: nothing.
//   error   an exposure that was left out is predicted to more than 5 codes.
//   jumps   the curve grows threefold within 5 codes above code 32, where no camera's does: a gamma
//           of 2.2 grows by 1.37.
// `clips_from` is the code that the table's clip_share stands for, if it was measured; a jump's
// advice then names it.
std::vector<std::string> doubts_of(const ResponseFit& fit, std::optional<int> clips_from = {});

// Returns the better of fits to one bracket: that of the least error, where a curve that does not
// rise over a share of its codes, and cannot tell their light apart, counts as that share worse.
// There is at least one.
const ResponseFit& better_fit(std::span<const ResponseFit> fits);

// Returns a curve through 256 positive values that may not increase, in the form that a set file
// takes: isotonic in the logarithm, strictly increasing from 0 to 1.
ResponseCurve monotone_curve(std::vector<double> signal_by_code);

}  // namespace previz::calibrate
