#include "daemon/core/tracking/edge.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <opencv2/core.hpp>
#include <vector>

#include "daemon/core/tracking/least_squares.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "drivers/calibration/pinhole.hpp"

namespace previz::tracking {
namespace {

constexpr double kSearchStepPx = 0.5;
constexpr int kSearchSteps = 4;                             // to either side
constexpr double kSearchPx = kSearchSteps * kSearchStepPx;  // how far off the guess may be
constexpr double kMinContrast = 0.05;                       // sRGB-encoded, 13 of 255
constexpr double kMaxBlurPx = 4.0;
constexpr double kMinNoise = 0.003;  // share of the contrast; about 8-bit rounding of white
constexpr double kClipped = 0.99;    // linear; a brighter sample counts as clipped
constexpr double kClippedVariance = 0.15 * 0.15;  // px^2
constexpr int kMaxColumns = 200;                  // pixel columns used of a long edge
constexpr int kQuickColumns = 50;                 // likewise, until the last round of a quick fit

// A pixel near the edge. Its distance to the line is (offset - shift of the line) * scale.
struct Sample {
  double along;   // 0 at a, 1 at b
  double offset;  // undistorted px, positive on the bright side
  double scale;   // picture px per undistorted px across the line
  double nx, ny;  // unit normal in the picture
  double value;   // linear
  Fit how;        // how its coverage is computed
  double weight = 1;
};

// Shading across the edge is deliberately not a parameter: it moves the line by thousandths of a
// pixel, but the fit would use it to absorb one side of a blur that is not Gaussian, which moves
// the line by tenths.
constexpr int kEndA = 0, kEndB = 1, kBlack = 2, kWhite = 3, kBlur = 4, kShade = 5, kParameters = 6;
using Vector = cv::Matx<double, kParameters, 1>;

// The priors' standard deviations, for parameters that short edges do not determine: relative
// shading over the edge's length, and blur in px.
constexpr double kShadePrior = 0.3, kBlurPrior = 1.0;

struct Line {
  glm::dvec2 a, b, normal;
  double length;
};

Line make_line(glm::dvec2 a, glm::dvec2 b, glm::dvec2 bright_side) {
  const double length = glm::distance(a, b);
  glm::dvec2 normal(-(b - a).y / length, (b - a).x / length);
  if (glm::dot(normal, bright_side - a) < 0) normal = -normal;
  return {a, b, normal, length};
}

// Collects the pixels within [-dark, bright] px of the line and between its ends less `margin_px`.
std::vector<Sample> gather(const Luminance& luminance, const PinholeIntrinsics& lens,
                           const Line& line, double dark, double bright, double margin_px, Fit how,
                           int columns) {
  std::vector<Sample> samples;
  const glm::dvec2 focal(lens.fx, lens.fy), centre(lens.cx, lens.cy);
  const glm::dvec2 pa = distort(lens, (line.a - centre) / focal);
  const glm::dvec2 pb = distort(lens, (line.b - centre) / focal);
  const glm::dvec2 d = pb - pa;
  const int major = std::abs(d.x) >= std::abs(d.y) ? 0 : 1;
  const int minor = 1 - major;
  const int size[2] = {lens.width, lens.height};
  const double margin = margin_px / line.length;
  // The reach is 2 px more than a straight edge needs, because the lens may bend it.
  const double reach = (std::max(dark, bright) + 2) * glm::length(d) / std::abs(d[major]);

  const int first = std::max(0, int(std::ceil(std::min(pa[major], pb[major]))));
  const int last = std::min(size[major] - 1, int(std::floor(std::max(pa[major], pb[major]))));
  const int stride = std::max(1, (last - first + 1) / columns);
  for (int i = first; i <= last; i += stride) {
    const double at = pa[minor] + (i - pa[major]) * d[minor] / d[major];
    const int low = std::max(0, int(std::ceil(at - reach)));
    const int high = std::min(size[minor] - 1, int(std::floor(at + reach)));
    for (int j = low; j <= high; ++j) {
      const int x = major == 0 ? i : j, y = major == 0 ? j : i;
      const auto ray = undistort(lens, {x, y});
      if (!ray) continue;
      const glm::dvec2 u = *ray * focal + centre;
      Sample s;
      s.along = glm::dot(u - line.a, line.b - line.a) / (line.length * line.length);
      if (s.along < margin || s.along > 1 - margin) continue;
      s.offset = glm::dot(u - line.a, line.normal);
      glm::dmat2 pixel_by_ray;
      distort(lens, *ray, &pixel_by_ray);
      // This is d(offset)/d(pixel); its length is in undistorted px per picture px.
      const glm::dvec2 gradient =
          glm::transpose(glm::inverse(pixel_by_ray)) * (line.normal * focal);
      const double steepness = glm::length(gradient);
      s.scale = 1 / steepness;
      s.nx = gradient.x / steepness;
      s.ny = gradient.y / steepness;
      const double distance = s.offset * s.scale;
      if (distance < -dark || distance > bright) continue;
      s.value = luminance(x, y);
      s.how = how;
      samples.push_back(s);
    }
  }
  return samples;
}

double predict(const Vector& p, const Sample& s, Vector* gradient) {
  const double distance = (s.offset - p(kEndA) * (1 - s.along) - p(kEndB) * s.along) * s.scale;
  double by_s, by_blur;
  const double c = edge_coverage(distance, s.nx, s.ny, p(kBlur), &by_s, &by_blur, s.how);
  const double plain = p(kBlack) + (p(kWhite) - p(kBlack)) * c;
  const double shade = 1 + p(kShade) * (s.along - 0.5);
  const double light = plain * shade;
  const double slope = light < 1 ? 1 : 0;  // the sensor clips
  if (gradient) {
    const double step = (p(kWhite) - p(kBlack)) * shade;
    const double by_distance = slope * step * by_s;
    (*gradient)(kEndA) = -by_distance * (1 - s.along) * s.scale;
    (*gradient)(kEndB) = -by_distance * s.along * s.scale;
    (*gradient)(kBlack) = slope * shade * (1 - c);
    (*gradient)(kWhite) = slope * shade * c;
    (*gradient)(kBlur) = slope * step * by_blur;
    (*gradient)(kShade) = slope * plain * (s.along - 0.5);
  }
  return std::min(light, 1.0);
}

double tukey_loss(double r, double cutoff) {
  const double q = std::min(1.0, r * r / (cutoff * cutoff));
  return cutoff * cutoff / 6 * (1 - (1 - q) * (1 - q) * (1 - q));
}

double tukey_weight(double r, double cutoff) {
  const double q = r * r / (cutoff * cutoff);
  return q < 1 ? (1 - q) * (1 - q) : 0;
}

NormalEquations<kParameters> linearise(std::vector<Sample>& samples, const Vector& p, double cutoff,
                                       double noise) {
  static const Vector priors(0, 0, 0, 0, 1 / (kBlurPrior * kBlurPrior),
                             1 / (kShadePrior * kShadePrior));
  NormalEquations<kParameters> sum;
  for (Sample& s : samples) {
    Vector g;
    const double r = s.value - predict(p, s, &g);
    s.weight = tukey_weight(r, cutoff);
    sum.cost += tukey_loss(r, cutoff);
    for (int i = 0; i < kParameters; ++i) {
      sum.gradient(i) += s.weight * r * g(i);
      for (int j = 0; j <= i; ++j) sum.information(i, j) += s.weight * g(i) * g(j);
    }
  }
  for (int i = 0; i < kParameters; ++i) {
    const double prior = noise * noise * priors(i);
    sum.cost += 0.5 * prior * p(i) * p(i);
    sum.information(i, i) += prior;
    sum.gradient(i) -= prior * p(i);
    for (int j = 0; j < i; ++j) sum.information(j, i) = sum.information(i, j);
  }
  return sum;
}

struct EdgeProblem {
  std::vector<Sample>& samples;
  double cutoff, noise;

  NormalEquations<kParameters> evaluate(const Vector& p) const {
    return linearise(samples, p, cutoff, noise);
  }

  static Vector moved(const Vector& p, const Vector& step) {
    Vector next = p + step;
    next(kBlur) = std::clamp(std::abs(next(kBlur)), 1e-3, kMaxBlurPx);
    next(kBlack) = std::max(next(kBlack), 0.0);
    return next;
  }

  static bool settled(const Vector& from, const Vector& to) {
    return std::abs(to(kEndA) - from(kEndA)) + std::abs(to(kEndB) - from(kEndB)) < 1e-4;
  }
};

double percentile(std::vector<double> values, double q) {
  const auto nth = values.begin() + std::ptrdiff_t(q * double(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double median_residual(const std::vector<Sample>& samples, const Vector& p) {
  std::vector<double> r;
  r.reserve(samples.size());
  for (const Sample& s : samples) r.push_back(std::abs(s.value - predict(p, s, nullptr)));
  return percentile(std::move(r), 0.5);
}

// Returns the values of the plain areas, and the shift and blur that fit best on a coarse grid. A
// clipped white may be anything above 1.
Vector coarse_start(const std::vector<Sample>& samples) {
  std::vector<double> values;
  for (const Sample& s : samples) values.push_back(s.value);
  const double white = percentile(values, 0.9);
  const std::vector<double> whites =
      white < kClipped ? std::vector<double>{white} : std::vector<double>{1, 1.4, 2, 3};
  Vector best;
  double least = HUGE_VAL;
  for (double bright : whites) {
    for (int step = -kSearchSteps; step <= kSearchSteps; ++step) {
      const double shift = step * kSearchStepPx;
      Vector p = Vector::all(0);
      p(kBlack) = percentile(values, 0.1);
      p(kWhite) = bright;
      p(kBlur) = 0.5;
      p(kEndA) = p(kEndB) = shift;
      double squares = 0;
      for (const Sample& s : samples) {
        const double r = s.value - predict(p, s, nullptr);
        squares += r * r;
      }
      if (squares < least) least = squares, best = p;
    }
  }
  return best;
}

bool visible(const Vector& p) {
  return srgb_encode(p(kWhite)) - srgb_encode(p(kBlack)) > kMinContrast;
}

struct NormalAt {
  double phi, density;
};

NormalAt exact_normal(double z) {
  const double density = std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
  return {0.5 * std::erfc(-z / std::numbers::sqrt2), density};
}

// Interpolates for |z| <= 6 by cubic Hermite splines with the exact slopes, d and -z d: within h^4
// / 384 of the fourth derivative, which is at most 1.2 of either.
NormalAt normal_by_table(double z) {
  constexpr int knots_a_unit = 64, knots = 12 * knots_a_unit;
  constexpr double h = 1.0 / knots_a_unit;
  static const std::array<NormalAt, knots + 1> table = [] {
    std::array<NormalAt, knots + 1> values;
    for (std::size_t i = 0; i <= knots; ++i) values[i] = exact_normal(double(i) * h - 6);
    return values;
  }();
  const double at = std::clamp((z + 6) * knots_a_unit, 0.0, double(knots));
  const int i = std::min(int(at), knots - 1);
  const NormalAt &a = table[std::size_t(i)], &b = table[std::size_t(i) + 1];
  const double u = at - i, v = 1 - u, za = i * h - 6, zb = za + h;
  const double of_a = (1 + 2 * u) * v * v, of_b = u * u * (1 + 2 * v);
  const double slope_a = h * u * v * v, slope_b = -h * u * u * v;
  return {of_a * a.phi + of_b * b.phi + slope_a * a.density + slope_b * b.density,
          (of_a - slope_a * za) * a.density + (of_b - slope_b * zb) * b.density};
}

// Holds Phi(x) and the integrals E[max(x + z,0)], E[max(x + z,0)^2]/2 of a Gaussian z.
struct Ramp {
  double step, ramp, parabola;
};
Ramp gaussian_ramp(double x, double sigma, Fit how) {
  if (x > 6 * sigma) return {1, x, (x * x + sigma * sigma) / 2};
  if (x < -6 * sigma) return {0, 0, 0};
  const double z = x / sigma;
  const auto [phi, density] = how == Fit::exact ? exact_normal(z) : normal_by_table(z);
  return {phi, x * phi + sigma * density,
          0.5 * ((x * x + sigma * sigma) * phi + x * sigma * density)};
}

}  // namespace

// A half plane seen through the pixel's box is its indicator smoothed by two boxes, of widths |nx|
// and |ny|, along the normal: second differences of the twice-integrated (Gaussian) step.
double edge_coverage(double s, double nx, double ny, double blur_px, double* by_s, double* by_blur,
                     Fit how) {
  const double a = std::max(std::abs(nx), 1e-4), b = std::max(std::abs(ny), 1e-4);
  const double sigma = std::max(blur_px, 1e-6);
  const auto ramp = [&](double x) { return gaussian_ramp(x, sigma, how); };
  const Ramp r[4] = {ramp(s + (a + b) / 2), ramp(s + (a - b) / 2), ramp(s - (a - b) / 2),
                     ramp(s - (a + b) / 2)};
  const double area = a * b;
  if (by_s) *by_s = (r[0].ramp - r[1].ramp - r[2].ramp + r[3].ramp) / area;
  if (by_blur) *by_blur = sigma * (r[0].step - r[1].step - r[2].step + r[3].step) / area;
  return (r[0].parabola - r[1].parabola - r[2].parabola + r[3].parabola) / area;
}

std::optional<EdgeFit> fit_edge(const Luminance& luminance, const PinholeIntrinsics& lens,
                                const EdgeGuess& guess, const char** why, Fit how) {
  Line line = make_line(guess.a, guess.b, guess.bright_side);
  if (!(line.length > 4)) return *why = "too short", std::nullopt;

  double dark = std::clamp(0.8 * guess.dark_depth_px, 1.2, 4.0);
  double bright = std::clamp(0.8 * guess.bright_depth_px, 1.2, 4.0);
  double margin = std::min(0.2 * line.length, 5.0);
  Vector p = Vector::all(0);
  double noise = 0, total_shift = 0;
  std::vector<Sample> samples;
  for (int round = 0; round < 3; ++round) {
    samples = gather(luminance, lens, line, dark, bright, margin, how,
                     how == Fit::quick && round < 2 ? kQuickColumns : kMaxColumns);
    if (samples.size() < 12) return *why = "cut by the picture's border", std::nullopt;
    if (round == 0) p = coarse_start(samples);
    if (!visible(p)) return *why = "without contrast", std::nullopt;
    const double contrast = p(kWhite) - p(kBlack);
    const double least_noise = kMinNoise * contrast;
    // The cutoff is wide at first, so that a shifted start does not make outliers of good pixels.
    const double cutoff = round == 0 ? 10 * contrast : std::max(6 * noise, 0.15 * contrast);
    const auto minimum = least_squares(EdgeProblem{samples, cutoff, std::max(noise, least_noise)},
                                       p, {round == 0 ? 15 : 8});
    if (minimum.why == Stopped::outside) return *why = "impossible to fit", std::nullopt;
    p = minimum.at;
    noise = std::max(least_noise, 1.4826 * median_residual(samples, p));

    line = make_line(line.a + line.normal * p(kEndA), line.b + line.normal * p(kEndB),
                     line.a + line.normal * 1e3);
    total_shift += std::max(std::abs(p(kEndA)), std::abs(p(kEndB)));
    if (round < 2) p(kEndA) = p(kEndB) = 0;
    if (total_shift > 1.5 * kSearchPx + 2 * p(kBlur))
      return *why = "not where the detector saw it", std::nullopt;
    // The fit stays clear of the next printed cell and of the corners by the reach of the blur, and
    // uses the same depth on both sides, so that a blur that is not Gaussian cannot shift the line.
    const double free = std::min(guess.dark_depth_px, guess.bright_depth_px) - 0.5 - 2 * p(kBlur);
    dark = bright = std::clamp(free, 1.2, 1.5 + 3 * p(kBlur));
    margin = std::min(0.25 * line.length, 1 + 2.5 * p(kBlur));
  }

  if (!visible(p)) return *why = "without contrast", std::nullopt;
  const double contrast = p(kWhite) - p(kBlack);
  const auto equations = linearise(samples, p, std::max(6 * noise, 0.15 * contrast), noise);
  double weight = 0, squares = 0;
  std::size_t outliers = 0;
  for (const Sample& s : samples) {
    const double r = s.value - predict(p, s, nullptr);
    weight += s.weight;
    squares += s.weight * r * r;
    outliers += s.weight < 0.1;
  }
  if (3 * outliers > samples.size()) return *why = "covered", std::nullopt;
  const double rms =
      std::max(kMinNoise * contrast, std::sqrt(squares / std::max(1.0, weight - kParameters)));
  if (rms > 0.2 * contrast) return *why = "unclear", std::nullopt;
  // A white that nothing determines, because all of it is clipped, is held. Where the rest is
  // singular as well, only the clipping counts, below.
  const auto covariance =
      inverse_of(equations.information).value_or(decltype(equations.information)::zeros()) *
      (rms * rms);
  // If many samples are clipped, the true white is only a guess, and with it the place where half
  // of it is reached: the variance grows.
  const auto whites = std::count_if(samples.begin(), samples.end(),
                                    [](const Sample& x) { return x.value >= kClipped; });
  const double clipped = 10 * whites > std::ptrdiff_t(samples.size()) ? kClippedVariance : 0;
  EdgeFit fit;
  fit.a = line.a;
  fit.b = line.b;
  fit.var_a = covariance(kEndA, kEndA) + clipped;
  fit.cov_ab = covariance(kEndA, kEndB) + clipped / 2;
  fit.var_b = covariance(kEndB, kEndB) + clipped;
  fit.blur_px = p(kBlur);
  fit.contrast = contrast;
  fit.noise = rms;
  if (!(fit.var_a > 0 && fit.var_b > 0)) return *why = "impossible to fit", std::nullopt;
  return fit;
}

}  // namespace previz::tracking
