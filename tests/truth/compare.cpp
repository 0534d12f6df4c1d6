#include "tests/truth/compare.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <glm/common.hpp>

#include "daemon/core/lighting/response.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::truth {
namespace {

constexpr int block_px = 8;

glm::dvec3 clipped(const glm::vec3& radiance, double white) {
  return glm::clamp(glm::dvec3(radiance), 0.0, white);
}

std::size_t at(int width, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

// rms of an error over rms of the signal, over block means and channels.
struct BlockSums {
  double error2 = 0, signal2 = 0, error = 0, signal = 0;
  int blocks = 0;

  void add(const glm::dvec3& estimate, const glm::dvec3& wanted, const glm::dvec3& truth) {
    for (int c = 0; c < 3; ++c) {
      error2 += (estimate[c] - wanted[c]) * (estimate[c] - wanted[c]);
      signal2 += truth[c] * truth[c];
      error += estimate[c] - wanted[c];
      signal += truth[c];
    }
    ++blocks;
  }
  double relative_rms() const { return signal2 > 0 ? std::sqrt(error2 / signal2) : 0; }
  double bias() const { return signal != 0 ? error / signal : 0; }
  double signal_rms() const { return blocks > 0 ? std::sqrt(signal2 / (3 * blocks)) : 0; }
};

using PixelValue = std::function<glm::dvec3(std::size_t)>;

glm::dvec3 block_mean(const PixelValue& value, int width, int bx, int by) {
  glm::dvec3 sum(0);
  for (int y = 0; y < block_px; ++y) {
    for (int x = 0; x < block_px; ++x) {
      sum += value(at(width, bx * block_px + x, by * block_px + y));
    }
  }
  return sum / static_cast<double>(block_px * block_px);
}

enum class BlockKind { uncovered, covered, edge };

BlockKind kind_of(const TruthFrame& truth, int bx, int by) {
  int zeros = 0, ones = 0;
  for (int y = 0; y < block_px; ++y) {
    for (int x = 0; x < block_px; ++x) {
      const float m = truth.mask[at(truth.width, bx * block_px + x, by * block_px + y)];
      zeros += m == 0;
      ones += m == 1;
    }
  }
  if (zeros == block_px * block_px) return BlockKind::uncovered;
  return ones == block_px * block_px ? BlockKind::covered : BlockKind::edge;
}

// Pixels at most 2 away (along x and y each) from a pixel on the truth mask's edge: one that is
// partly covered or differs from a neighbour to the left, right, above or below.
std::vector<bool> near_mask_edge(const TruthFrame& truth) {
  const int w = truth.width, h = truth.height;
  std::vector<bool> near(truth.mask.size(), false);
  const auto differs = [&](int x, int y, float m) {
    return x >= 0 && x < w && y >= 0 && y < h && truth.mask[at(w, x, y)] != m;
  };
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const float m = truth.mask[at(w, x, y)];
      const bool edge = (m > 0 && m < 1) || differs(x - 1, y, m) || differs(x + 1, y, m) ||
                        differs(x, y - 1, m) || differs(x, y + 1, m);
      if (!edge) continue;
      for (int ny = std::max(0, y - 2); ny <= std::min(h - 1, y + 2); ++ny) {
        for (int nx = std::max(0, x - 2); nx <= std::min(w - 1, x + 2); ++nx) {
          near[at(w, nx, ny)] = true;
        }
      }
    }
  }
  return near;
}

void measure_mask(const TruthFrame& truth, const EstimatedFrame& wanted,
                  const EstimatedFrame& estimate, Measures& out) {
  const std::vector<bool> near = near_mask_edge(truth);
  double near_sum = 0;
  std::size_t near_count = 0;
  for (std::size_t i = 0; i < truth.mask.size(); ++i) {
    const double error = std::abs(static_cast<double>(estimate.mask[i]) - wanted.mask[i]);
    out.e_mask += error / static_cast<double>(truth.mask.size());
    if (near[i]) {
      near_sum += error;
      ++near_count;
    }
  }
  if (near_count > 0) out.e_mask_edge = near_sum / static_cast<double>(near_count);
}

void require_sizes(const TruthFrame& truth, const EstimatedFrame& estimate) {
  const auto n = static_cast<std::size_t>(truth.width) * static_cast<std::size_t>(truth.height);
  for (const std::size_t size :
       {truth.plate.size(), truth.real.size(), truth.mixed.size(), truth.mask.size(),
        estimate.composite.size(), estimate.mixed.size(), estimate.real.size(),
        estimate.diff.size(), estimate.mask.size(), estimate.picture.samples.size() / 3}) {
    if (size != n) {
      throw Error("compare: a picture has " + std::to_string(size) +
                  " pixels where the truth has " + std::to_string(truth.width) + "x" +
                  std::to_string(truth.height));
    }
  }
}

// Gaussian window means of a plane, 11 taps, valid positions only.
std::vector<double> window_means(const std::vector<double>& plane, int width, int height) {
  constexpr int taps = 11;
  double kernel[taps];
  double sum = 0;
  for (int i = 0; i < taps; ++i) sum += kernel[i] = std::exp(-(i - 5) * (i - 5) / (2 * 1.5 * 1.5));
  for (double& k : kernel) k /= sum;
  const int w = width - taps + 1, h = height - taps + 1;
  std::vector<double> rows(static_cast<std::size_t>(w) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < w; ++x) {
      for (int i = 0; i < taps; ++i) rows[at(w, x, y)] += kernel[i] * plane[at(width, x + i, y)];
    }
  }
  std::vector<double> out(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      for (int i = 0; i < taps; ++i) out[at(w, x, y)] += kernel[i] * rows[at(w, x, y + i)];
    }
  }
  return out;
}

double plane_ssim(const std::vector<double>& a, const std::vector<double>& b, int width,
                  int height) {
  const auto product = [](const std::vector<double>& p, const std::vector<double>& q) {
    std::vector<double> out(p.size());
    std::transform(p.begin(), p.end(), q.begin(), out.begin(), std::multiplies<>());
    return out;
  };
  const auto mean_a = window_means(a, width, height);
  const auto mean_b = window_means(b, width, height);
  const auto mean_aa = window_means(product(a, a), width, height);
  const auto mean_bb = window_means(product(b, b), width, height);
  const auto mean_ab = window_means(product(a, b), width, height);
  const double c1 = 0.01 * 255 * 0.01 * 255, c2 = 0.03 * 255 * 0.03 * 255;
  double sum = 0;
  for (std::size_t i = 0; i < mean_a.size(); ++i) {
    const double ma = mean_a[i], mb = mean_b[i];
    const double va = mean_aa[i] - ma * ma, vb = mean_bb[i] - mb * mb;
    const double cov = mean_ab[i] - ma * mb;
    sum += (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
  }
  return sum / static_cast<double>(mean_a.size());
}

EstimatedFrame ideal_estimate(const TruthFrame& truth) {
  EstimatedFrame out;
  out.composite = ideal_composite(truth);
  out.mixed = truth.mixed;
  out.real = truth.real;
  for (std::size_t i = 0; i < truth.mixed.size(); ++i)
    out.diff.push_back(truth.mixed[i] - truth.real[i]);
  out.mask = truth.mask;
  out.picture = displayed(out.composite, truth.width, truth.height, truth.exposure, truth.response);
  return out;
}

// The measures of an estimate against what is wanted, relative to the truth.
Measures compare_with(const TruthFrame& truth, const EstimatedFrame& wanted,
                      const EstimatedFrame& estimate) {
  const double white = 1 / truth.exposure;
  const auto diff = [&](const EstimatedFrame& of) -> PixelValue {
    return [&](std::size_t i) {
      if (of.is_as_shown) return clipped(of.composite[i], white) - clipped(truth.plate[i], white);
      return clipped(truth.real[i] + of.diff[i], white) - clipped(truth.real[i], white);
    };
  };
  const auto clip = [&](std::span<const glm::vec3> picture) -> PixelValue {
    return [picture, white](std::size_t i) { return clipped(picture[i], white); };
  };
  const PixelValue true_diff = [&](std::size_t i) {
    return clipped(truth.mixed[i], white) - clipped(truth.real[i], white);
  };
  const render::Sheet<glm::vec3> ideal = ideal_composite(truth);

  BlockSums diff_sums, virtual_sums, edge_sums, real_sums;
  for (int by = 0; by < truth.height / block_px; ++by) {
    for (int bx = 0; bx < truth.width / block_px; ++bx) {
      const auto mean = [&](const PixelValue& value) {
        return block_mean(value, truth.width, bx, by);
      };
      real_sums.add(mean(clip(estimate.real)), mean(clip(wanted.real)), mean(clip(truth.real)));
      switch (kind_of(truth, bx, by)) {
        case BlockKind::uncovered:
          diff_sums.add(mean(diff(estimate)), mean(diff(wanted)), mean(true_diff));
          break;
        case BlockKind::covered:
          virtual_sums.add(mean(clip(estimate.mixed)), mean(clip(wanted.mixed)),
                           mean(clip(truth.mixed)));
          break;
        case BlockKind::edge:
          edge_sums.add(mean(clip(estimate.composite)), mean(clip(wanted.composite)),
                        mean(clip(ideal)));
      }
    }
  }

  Measures out;
  out.e_diff = diff_sums.relative_rms();
  out.e_virtual = virtual_sums.relative_rms();
  out.e_edge = edge_sums.relative_rms();
  out.e_real = real_sums.relative_rms();
  out.bias_diff = diff_sums.bias();
  out.bias_virtual = virtual_sums.bias();
  out.bias_real = real_sums.bias();
  out.diff_blocks = diff_sums.blocks;
  out.virtual_blocks = virtual_sums.blocks;
  out.edge_blocks = edge_sums.blocks;
  measure_mask(truth, wanted, estimate, out);
  out.psnr = psnr(estimate.picture, wanted.picture);
  out.ssim = ssim(estimate.picture, wanted.picture);

  if (truth.diff_rmse && diff_sums.signal_rms() > 0) {
    out.noise_diff = *truth.diff_rmse / block_px / diff_sums.signal_rms();
  }
  if (truth.mixed_rmse_of_mean && virtual_sums.signal_rms() > 0) {
    double picture_mean = 0;
    for (const glm::vec3& value : truth.mixed) {
      const glm::dvec3 c = clipped(value, white);
      picture_mean += (c.x + c.y + c.z) / 3 / static_cast<double>(truth.mixed.size());
    }
    out.noise_virtual =
        *truth.mixed_rmse_of_mean * picture_mean / block_px / virtual_sums.signal_rms();
  }
  return out;
}

// Mean square of a picture's error over that of white.
double mean_square(double psnr_db) {
  return std::pow(10.0, -psnr_db / 10);
}

}  // namespace

Measures compare(const TruthFrame& truth, const EstimatedFrame& estimate) {
  require_sizes(truth, estimate);
  return compare_with(truth, ideal_estimate(truth), estimate);
}

Chance chance_between(const TruthFrame& truth, const EstimatedFrame& a, const EstimatedFrame& b) {
  require_sizes(truth, a);
  require_sizes(truth, b);
  const Measures apart = compare_with(truth, a, b);
  Chance out;
  out.e_diff = apart.e_diff / std::sqrt(2.0);
  out.e_virtual = apart.e_virtual / std::sqrt(2.0);
  out.e_edge = apart.e_edge / std::sqrt(2.0);
  out.e_mask = apart.e_mask;
  out.e_mask_edge = apart.e_mask_edge;
  out.mean_square = mean_square(apart.psnr) / 2;
  out.dissimilarity = 1 - apart.ssim;
  return out;
}

render::Sheet<glm::vec3> ideal_composite(const TruthFrame& truth) {
  const double white = 1 / truth.exposure;
  render::Sheet<glm::vec3> out(truth.mixed.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const glm::dvec3 mixed = clipped(truth.mixed[i], white);
    const glm::dvec3 uncovered =
        clipped(truth.plate[i], white) + mixed - clipped(truth.real[i], white);
    const double m = truth.mask[i];
    out[i] = glm::vec3(m * mixed + (1 - m) * uncovered);
  }
  return out;
}

Plate displayed(std::span<const glm::vec3> radiance, int width, int height, double exposure,
                const ResponseCurve& response) {
  const lighting::Response curve(response, 8);
  Plate plate;
  plate.width = width;
  plate.height = height;
  plate.bits = 8;
  plate.samples.reserve(3 * radiance.size());
  for (const glm::vec3& value : radiance) {
    for (int c = 0; c < 3; ++c) {
      plate.samples.push_back(curve.forward(exposure * static_cast<double>(value[c])));
    }
  }
  return plate;
}

EstimatedFrame composited(const TruthFrame& truth, EstimatedFrame estimate) {
  estimate.composite.clear();
  for (std::size_t i = 0; i < estimate.mask.size(); ++i) {
    const float m = estimate.mask[i];
    estimate.composite.push_back(m * estimate.mixed[i] +
                                 (1 - m) * (truth.plate[i] + estimate.diff[i]));
  }
  estimate.picture =
      displayed(estimate.composite, truth.width, truth.height, truth.exposure, truth.response);
  return estimate;
}

EstimatedFrame as_composited(std::span<const glm::vec3> plate, EstimatedFrame estimate) {
  estimate.is_as_shown = !plate.empty();
  for (std::size_t i = 0; i < estimate.composite.size(); ++i) {
    if (estimate.mask[i] == 0)
      estimate.diff[i] = estimate.composite[i] - (plate.empty() ? glm::vec3(0) : plate[i]);
    if (estimate.mask[i] == 1) estimate.mixed[i] = estimate.composite[i];
  }
  return estimate;
}

double psnr(const Plate& a, const Plate& b) {
  double squares = 0;
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    const double d = static_cast<double>(a.samples[i]) - b.samples[i];
    squares += d * d;
  }
  if (squares == 0) return identical_psnr;
  return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.samples.size()) / squares);
}

double ssim(const Plate& a, const Plate& b) {
  if (a.width < 11 || a.height < 11) {
    throw Error("ssim: a picture of " + std::to_string(a.width) + "x" + std::to_string(a.height) +
                " is smaller than its 11x11 window");
  }
  double sum = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<double> plane_a, plane_b;
    for (std::size_t i = c; i < a.samples.size(); i += 3) {
      plane_a.push_back(a.samples[i]);
      plane_b.push_back(b.samples[i]);
    }
    sum += plane_ssim(plane_a, plane_b, a.width, a.height) / 3;
  }
  return sum;
}

Bounds bounds_named(const std::string& name) {
  if (name == "paired") return {name, 0.06, 0.03, 0.002, 40, 0.98, true};
  if (name == "full") return {name, 0.03, 0.02, 0.0015, 42, 0.985, true};
  if (name == "captured") return {name, 0.10, 0.06, 0.01, 34, 0.96, false};
  throw Error("bounds: '" + name + "' is not one of paired, full, captured");
}

std::vector<std::string> violations(const Measures& m, const Bounds& bounds, const Chance& chance) {
  std::vector<std::string> out;
  const auto check = [&](const char* name, double value, double allowed, bool at_most) {
    if (at_most ? value <= allowed : value >= allowed) return;
    char line[128];
    std::snprintf(line, sizeof line, "%s is %.5g, %s %.5g is allowed", name, value,
                  at_most ? "at most" : "at least", allowed);
    out.emplace_back(line);
  };
  const double noise_diff = m.noise_diff.value_or(0), noise_virtual = m.noise_virtual.value_or(0);
  check("e_diff", m.e_diff, std::hypot(bounds.e_diff, noise_diff, chance.e_diff), true);
  check("e_virtual", m.e_virtual, std::hypot(bounds.e_virtual, noise_virtual, chance.e_virtual),
        true);
  check("e_edge", m.e_edge, std::hypot(bounds.e_virtual, noise_virtual, chance.e_edge), true);
  check("e_mask", m.e_mask, bounds.e_mask + chance.e_mask, true);
  if (bounds.true_pose) check("e_mask_edge", m.e_mask_edge, 0.03 + chance.e_mask_edge, true);
  check("psnr", m.psnr, -10 * std::log10(mean_square(bounds.psnr) + chance.mean_square), false);
  check("ssim", m.ssim, bounds.ssim - chance.dissimilarity, false);
  return out;
}

}  // namespace previz::truth
