// The measures of a rendered frame against truth (docs: README.md, "Measures").
#pragma once

#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/render/picture/scratch.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::truth {

// All pictures are row-major, width * height, linear Rec. 709 radiance, not yet clipped.
struct TruthFrame {
  int width = 0, height = 0;
  double exposure = 1;  // absolute; the sensor's white is 1 / exposure
  ResponseCurve response;
  render::Sheet<glm::vec3> plate;  // Lc, from the observer frame's 8-bit samples
  render::Sheet<glm::vec3> real;   // Lr
  render::Sheet<glm::vec3> mixed;  // Lm
  render::Sheet<float> mask;       // M
  // The truth's own noise as its set.json states it, absent where it does not:
  std::optional<double> diff_rmse;           // of a pixel of mixed - real, radiance
  std::optional<double> mixed_rmse_of_mean;  // of a pixel of mixed (clipped), over the picture mean
};

struct EstimatedFrame {
  render::Sheet<glm::vec3> composite, mixed, real, diff;
  render::Sheet<float> mask;
  Plate picture;             // 8 bit
  bool is_as_shown = false;  // the composite is judged, and not the difference that it was made of
};

struct Measures {
  double e_diff = 0, e_virtual = 0, e_mask = 0, e_mask_edge = 0, e_edge = 0;
  double psnr = 0;  // dB; identical_psnr where the pictures are the same
  double ssim = 0;
  std::optional<double> noise_diff, noise_virtual;
  // These have no bound: the real solution alone, and signed errors of the means, relative.
  double e_real = 0;
  double bias_diff = 0, bias_virtual = 0, bias_real = 0;
  // Blocks each rms was taken over; a measure over none is 0.
  int diff_blocks = 0, virtual_blocks = 0, edge_blocks = 0;
};

inline constexpr double identical_psnr = 120;

// Throws previz::Error if the sizes differ or the picture is smaller than 11x11 (ssim's window).
Measures compare(const TruthFrame& truth, const EstimatedFrame& estimate);

// M Lm + (1 - M)(Lc + D), everything clipped at the sensor's white.
render::Sheet<glm::vec3> ideal_composite(const TruthFrame& truth);
// A picture as the display would show it, 8 bit.
Plate displayed(std::span<const glm::vec3> radiance, int width, int height, double exposure,
                const ResponseCurve& response);

// The estimate with its composite over the truth's plate, M Lm + (1 - M)(Lc + D) with its own M,
// and that as the display would show it.
EstimatedFrame composited(const TruthFrame& truth, EstimatedFrame estimate);

// The estimate with what its composite over a plate (empty: black) shows in place of diff, where
// its mask is 0, and of mixed, where it is 1: a composite from which noise was taken is not made of
// them. Clipping then applies to what is shown.
EstimatedFrame as_composited(std::span<const glm::vec3> plate, EstimatedFrame estimate);

double psnr(const Plate& a, const Plate& b);
// Wang et al. 2004: 11x11 Gaussian of sigma 1.5, K1 = 0.01, K2 = 0.03, windows wholly inside the
// picture; the mean over R, G and B.
double ssim(const Plate& a, const Plate& b);

// A row of the table in README.md, "Bounds".
struct Bounds {
  std::string name;
  double e_diff, e_virtual, e_mask, psnr, ssim;
  bool true_pose;  // e_mask_edge at most 0.03
};
// "paired", "full" or "captured"; throws previz::Error naming what is allowed.
Bounds bounds_named(const std::string& name);

// What too few samples may add to the errors of an estimate, so that bounds meant for many samples
// can judge it (README.md, "Few samples"). All zero: nothing.
struct Chance {
  double e_diff = 0, e_virtual = 0, e_edge = 0;  // standard errors, relative as the measures are
  double e_mask = 0, e_mask_edge = 0;            // mean absolute errors, at most
  double mean_square = 0;                        // of the 8-bit picture's error, over that of white
  double dissimilarity = 0;                      // 1 - ssim, at most
};
// From two estimates of the same frame at the same number of samples and with independent random
// numbers; holds for either of them. Throws as compare() does.
Chance chance_between(const TruthFrame& truth, const EstimatedFrame& a, const EstimatedFrame& b);

// One line a violated bound, with the figure and what is allowed (README.md, "Bounds" and "Few
// samples"); empty where all hold.
std::vector<std::string> violations(const Measures& measures, const Bounds& bounds,
                                    const Chance& chance = {});

}  // namespace previz::truth
