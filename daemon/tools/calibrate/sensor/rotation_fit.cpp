#include "daemon/tools/calibrate/sensor/rotation_fit.hpp"
#include "drivers/median.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/light_stage.hpp"
namespace previz::calibrate {
namespace {

using std::numbers::pi;

constexpr double degree = pi / 180;
constexpr double coarse_step = 15 * degree;
constexpr double apart = 45 * degree;
constexpr int coarse_samples = 16, fine_samples = 48;
// A pixel that is farther off counts as this far off: an edge, or a thing that the model lacks.
constexpr double most_off = 0.5;
// What codes, samples and the model's shape leave where the light is right.
constexpr double least_off = 0.01;
constexpr double squares_across = 27;  // the picture
constexpr std::size_t least_pixels_of_square = 3, least_squares_of_surface = 3;

// Between -pi and pi.
double around(double angle) {
  return std::remainder(angle, 2 * pi);
}

}  // namespace

ShadingOff shading_off(const SurfacePixels& seen) {
  double width = 0;
  for (const SurfacePixel& pixel : seen.pixels) width = std::max(width, pixel.px.x);
  // The noise of single pixels is evened out over squares of a surface.
  struct Square {
    double plate = 0, model = 0;
    std::size_t pixels = 0;
  };
  const double side = width / squares_across;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::map<std::pair<int, int>, Square>> surfaces;
  for (const SurfacePixel& pixel : seen.pixels) {
    Square& square =
        surfaces[{pixel.surface, pixel.frame}][{int(pixel.px.x / side), int(pixel.px.y / side)}];
    square.plate += pixel.plate.r + pixel.plate.g + pixel.plate.b;
    square.model += pixel.rendered.r + pixel.rendered.g + pixel.rendered.b;
    ++square.pixels;
  }
  ShadingOff off;
  double sum = 0;
  std::size_t count = 0;
  for (const auto& [surface, squares] : surfaces) {
    std::vector<double> logs;
    for (const auto& [place, square] : squares)
      if (square.pixels >= least_pixels_of_square && square.plate > 0 && square.model > 0)
        logs.push_back(std::log(square.plate / square.model));
    if (logs.size() < least_squares_of_surface) continue;
    const double middle = median(logs);
    double squared = 0;
    for (const double log : logs) {
      const double limited = std::min(std::abs(log - middle), most_off);
      squared += limited * limited;
    }
    const auto number = double(logs.size());
    sum += number * std::log(squared / number + least_off * least_off);
    count += logs.size();
  }
  off.patches = count;
  off.mean_square = count > 0 ? std::exp(sum / double(count)) : HUGE_VAL;
  return off;
}

ShadingAt shading_of(const pipeline::Take& take, const scene::Scene& scene,
                     const std::shared_ptr<render::Device>& device, int frames, int width) {
  struct Turned {
    set::Set set;
    std::optional<SurfaceProbe> probe;
  };
  const auto turned = std::make_shared<Turned>();
  turned->set = take.set;
  turned->set.lighting.mode = set::LightMode::image;
  turned->set.captured_lamps.clear();
  for (set::Light& light : turned->set.lights) light.captured = light.measured = false;
  turned->probe.emplace(take, scene, device, ProbeSize{.width = width});
  each_probed_shot(take, frames, [&](const ProbedShot& shot) { turned->probe->add(shot); });
  return [&take, &scene, turned](double rotation_rad, int samples) {
    turned->set.lighting.environment_rotation_rad =
        take.set.lighting.environment_rotation_rad + rotation_rad;
    turned->probe->light_by(pipeline::LightStage(turned->set, take.light, take.observer).light());
    return shading_off(turned->probe->compare(scene, samples));
  };
}

RotationFit fit_rotation(const ShadingAt& shading_at) {
  std::map<double, ShadingOff> fine;
  const auto look = [&](double angle) {
    auto found = fine.find(angle);
    if (found == fine.end()) found = fine.emplace(angle, shading_at(angle, fine_samples)).first;
    return found->second;
  };
  std::vector<std::pair<double, double>> coarse;  // angle and mean square
  for (int i = 0; i < int(std::lround(2 * pi / coarse_step)); ++i) {
    const double angle = around(i * coarse_step);
    coarse.emplace_back(angle, shading_at(angle, coarse_samples).mean_square);
  }
  const auto by_square = [](const auto& one) { return one.second; };
  double best = std::ranges::min_element(coarse, {}, by_square)->first;
  for (const double step : {5 * degree, 2 * degree, 1 * degree})
    for (bool moves = true; moves;) {
      const double from = best;
      for (const double next : {from - step, from + step})
        if (look(next).mean_square < look(best).mean_square) best = next;
      moves = best != from;
    }
  // The parabola through the best angle and its neighbours, farther away than the last step, whose
  // differences are within the noise of samples.
  const double step = 3 * degree;
  const double left = look(best - step).mean_square, middle = look(best).mean_square,
               right = look(best + step).mean_square;
  const double curvature = (left - 2 * middle + right) / (2 * step * step);
  RotationFit fit;
  const double move = curvature > 0 ? (left - right) / (4 * step * curvature) : 0;
  fit.rotation_rad = around(best + std::clamp(move, -step, step));
  fit.sigma_rad =
      curvature > 0
          ? std::max(0.5 * degree, std::sqrt(middle / curvature /
                                             double(std::max<std::size_t>(1, look(best).patches))))
          : pi;
  fit.off = std::sqrt(middle);
  fit.off_unturned = std::sqrt(look(0).mean_square);
  double second = HUGE_VAL;
  for (const auto& [angle, square] : coarse)
    if (std::abs(around(angle - best)) >= apart) second = std::min(second, square);
  const double coarse_best = by_square(*std::ranges::min_element(coarse, {}, by_square));
  fit.second = std::sqrt(second / coarse_best);
  return fit;
}

}  // namespace previz::calibrate
