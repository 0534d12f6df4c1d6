#include "daemon/tools/calibrate/sensor/vignetting_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <utility>

#include "daemon/core/lighting/response.hpp"
#include "daemon/tools/calibrate/sensor/signals.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t most_samples = 20000;
constexpr double least_signal = 0.02;      // a channel; excludes noise
constexpr double most_of_clipping = 0.97;  // a channel, over the signal that the camera clips at
constexpr int most_turns = 500;
constexpr double settled = 1e-12;

// Solves least squares of three parameters.
struct Normal3 {
  glm::dmat3 matrix{0.0};
  glm::dvec3 right{0};

  void add(const glm::dvec3& row, double value) {
    matrix += glm::outerProduct(row, row);
    right += value * row;
  }
  glm::dvec3 solved() const { return glm::inverse(matrix) * right; }
};

// Returns L, L gx and L gy of a picture, given V.
glm::dvec3 light_of(const FlatPicture& picture, const Vignetting& v) {
  Normal3 normal;
  for (const FlatSample& s : picture.samples)
    normal.add(relative_illumination(v, s.angle_rad) * glm::dvec3(1, s.x, s.y), s.signal);
  return normal.solved();
}

double radiance(const glm::dvec3& light, const FlatSample& s) {
  return light.x + light.y * s.x + light.z * s.y;
}

// Returns V from all pictures, given their light; each is weighted by its own level.
Vignetting falloff_of(const std::vector<FlatPicture>& pictures,
                      const std::vector<glm::dvec3>& lights) {
  Normal3 normal;
  for (std::size_t k = 0; k < pictures.size(); ++k)
    for (const FlatSample& s : pictures[k].samples) {
      const double even = radiance(lights[k], s) / lights[k].x, t2 = s.angle_rad * s.angle_rad;
      normal.add(even * glm::dvec3(t2, t2 * t2, t2 * t2 * t2), s.signal / lights[k].x - even);
    }
  const glm::dvec3 v = normal.solved();
  return {v.x, v.y, v.z};
}

void measure_residuals(std::vector<FlatPicture>& pictures, const std::vector<glm::dvec3>& lights,
                       VignettingFit& fit) {
  double all = 0, count = 0;
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    double sum = 0;
    for (const FlatSample& s : pictures[k].samples) {
      fit.widest_rad = std::max(fit.widest_rad, s.angle_rad);
      const double model =
          radiance(lights[k], s) * relative_illumination(fit.vignetting, s.angle_rad);
      sum += std::pow(s.signal / model - 1, 2);
    }
    const auto samples = static_cast<double>(pictures[k].samples.size());
    pictures[k].rms = std::sqrt(sum / samples);
    all += sum;
    count += samples;
  }
  fit.rms = std::sqrt(all / count);
}

// Returns the signal from which on a channel may be clipped.
double most_signal(const ResponseCurve& curve) {
  const lighting::Response response(curve, 8);
  return most_of_clipping * response.inverse()[response.clipping().at];
}

bool usable(const glm::dvec3& signal, double most) {
  return std::min({signal.r, signal.g, signal.b}) > least_signal &&
         std::max({signal.r, signal.g, signal.b}) < most;
}

}  // namespace

std::vector<FlatPicture> read_flat_pictures(PictureSource& source,
                                            const LightCameraCalibration& camera,
                                            std::vector<std::string>& notes) {
  const Fisheye lens(camera.intrinsics);
  const double most = most_signal(camera.response);
  std::vector<FlatPicture> pictures;
  while (const std::optional<NamedFrame> next = source.next()) {
    const SignalPicture seen = read_signals(next->frame, camera.response);
    if (seen.width != camera.intrinsics.width || seen.height != camera.intrinsics.height) {
      notes.push_back(fmt::format("{} is skipped: it has {}x{} pixels, the calibration {}x{}",
                                  next->name, seen.width, seen.height, camera.intrinsics.width,
                                  camera.intrinsics.height));
      continue;
    }
    const int step = 1 + static_cast<int>(std::sqrt(seen.signal.size() / most_samples));
    FlatPicture picture{next->name, {}};
    std::size_t looked_at = 0;
    for (int y = step / 2; y < seen.height; y += step)
      for (int x = step / 2; x < seen.width; x += step) {
        const auto direction = lens.unproject({x, y});
        if (!direction || !lens.pixel_at({x, y})) continue;
        ++looked_at;
        const glm::dvec3& signal =
            seen.signal[static_cast<std::size_t>(y) * static_cast<std::size_t>(seen.width) +
                        static_cast<std::size_t>(x)];
        if (!usable(signal, most)) continue;
        const glm::dvec3 light = signal - camera.dark_level;
        picture.samples.push_back({direction->x, direction->y,
                                   std::atan2(std::hypot(direction->x, direction->y), direction->z),
                                   light.r + light.g + light.b});
      }
    if (2 * picture.samples.size() < looked_at)
      notes.push_back(
          fmt::format("{} is skipped: more than half of it is black or white", next->name));
    else
      pictures.push_back(std::move(picture));
  }
  return pictures;
}

VignettingFit fit_vignetting(std::vector<FlatPicture>& pictures, double max_angle_rad) {
  if (pictures.empty()) throw Error("no usable picture is filled with even light");
  VignettingFit fit;
  std::vector<glm::dvec3> lights(pictures.size());
  for (int turn = 0; turn < most_turns; ++turn) {
    for (std::size_t k = 0; k < pictures.size(); ++k)
      lights[k] = light_of(pictures[k], fit.vignetting);
    const Vignetting before = std::exchange(fit.vignetting, falloff_of(pictures, lights));
    double change = 0;
    for (std::size_t i = 0; i < before.size(); ++i)
      change = std::max(change, std::abs(fit.vignetting[i] - before[i]));
    if (change < settled) break;
  }
  measure_residuals(pictures, lights, fit);
  const double least = least_illumination(fit.vignetting, max_angle_rad);
  if (!(least >= min_illumination))
    throw Error(
        fmt::format("the fit drops to {:.3f} of the light at some angle up to {:.0f} degrees, "
                    "less than {:g}: the pictures are not evenly lit, or the angle is too "
                    "wide",
                    least, max_angle_rad * 180 / std::numbers::pi, min_illumination));
  return fit;
}

}  // namespace previz::calibrate
