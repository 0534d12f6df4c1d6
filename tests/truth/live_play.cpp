#include "tests/truth/live_play.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <optional>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/core/scene/load.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"
#include "tests/truth/cpu_camera.hpp"

namespace previz::truth {
namespace {

// Points are taken this far apart, in pixels.
constexpr int flicker_step = 4;
// A point is seen if the ray to it ends within this share of its distance.
constexpr double seen_tolerance = 2e-3;

std::vector<glm::dvec3> radiance_of(const Plate& picture, const lighting::Response& response,
                                    double exposure) {
  std::vector<glm::dvec3> result;
  for (std::size_t i = 0; i < picture.samples.size(); i += 3)
    result.push_back(glm::dvec3(response.inverse()[picture.samples[i]],
                                response.inverse()[picture.samples[i + 1]],
                                response.inverse()[picture.samples[i + 2]]) /
                     exposure);
  return result;
}

}  // namespace

Flicker::Flicker(const scene::Scene& scene, const ObserverCalibration& calibration)
    : scene_(scene), calibration_(calibration), geometry_(scene) {
  geometry_.place(glm::dvec3(0));
}

// Returns whether a frame shows the point, and what it adds there.
bool Flicker::find(const Seen& frame, const glm::dvec3& point, glm::dvec3& added) const {
  const glm::dvec3 camera(frame.world_from_camera[3]);
  const glm::dvec3 seen = glm::transpose(glm::dmat3(frame.world_from_camera)) * (point - camera);
  if (seen.z <= 0) return false;
  const PinholeIntrinsics& k = calibration_.intrinsics;
  const glm::dvec2 at = distort(k, {seen.x / seen.z, seen.y / seen.z});
  if (!(at.x >= 0 && at.y >= 0 && at.x < k.width - 1 && at.y < k.height - 1)) return false;
  const double distance = glm::length(point - camera);
  const std::optional<Hit> hit =
      geometry_.closest({camera, (point - camera) / distance}, scene::world_both);
  if (!hit || scene_.instances[hit->instance].presence != scene::world_both ||
      std::abs(hit->distance - distance) > seen_tolerance * distance)
    return false;
  const glm::dvec2 low = glm::floor(at), f = at - low;
  const auto value = [&](int x, int y) {
    return frame.added[static_cast<std::size_t>((static_cast<int>(low.y) + y) * k.width +
                                                static_cast<int>(low.x) + x)];
  };
  added = glm::mix(glm::mix(value(0, 0), value(1, 0), f.x), glm::mix(value(0, 1), value(1, 1), f.x),
                   f.y);
  return true;
}

void Flicker::add(const LiveFrame& frame) {
  const lighting::Response response(calibration_.response, frame.picture.bits);
  Seen seen{frame.world_from_camera, radiance_of(frame.picture, response, frame.exposure)};
  const std::vector<glm::dvec3> plate = radiance_of(frame.plate, response, frame.exposure);
  for (std::size_t i = 0; i < plate.size(); ++i) seen.added[i] -= plate[i];
  last_.push_back(std::move(seen));
  if (last_.size() > 3) last_.erase(last_.begin());
  if (last_.size() == 3) add_middle();
}

void Flicker::add_middle() {
  const PinholeIntrinsics& k = calibration_.intrinsics;
  const Seen& middle = last_[1];
  const glm::dvec3 camera(middle.world_from_camera[3]);
  for (int y = flicker_step / 2; y < k.height; y += flicker_step)
    for (int x = flicker_step / 2; x < k.width; x += flicker_step) {
      const glm::dvec3 ray =
          glm::dmat3(middle.world_from_camera) * glm::normalize(undistorted_direction(k, x, y));
      const std::optional<Hit> hit = geometry_.closest({camera, ray}, scene::world_both);
      if (!hit || scene_.instances[hit->instance].presence != scene::world_both) continue;
      const glm::dvec3 point = camera + hit->distance * ray;
      glm::dvec3 before, after;
      if (!find(last_[0], point, before) || !find(last_[2], point, after)) continue;
      const glm::dvec3 off =
          middle.added[static_cast<std::size_t>(y * k.width + x)] - 0.5 * (before + after);
      squares_ += glm::dot(off, off);
      values_ += 3;
    }
}

double Flicker::rms() const {
  return values_ > 0 ? std::sqrt(squares_ / static_cast<double>(values_)) : 0;
}

void play_live(const std::filesystem::path& directory, const LiveSettings& settings,
               const std::function<void(const scene::Scene&, const ObserverCalibration&)>& begin,
               const std::function<void(const LiveFrame&)>& shown) {
  pipeline::Take take = pipeline::open_take(directory / "session", std::nullopt);
  take.set.quality.samples = settings.samples;
  take.set.quality.adaptive = false;
  take.set.quality.denoise = settings.denoise;
  take.set.quality.accumulate = settings.accumulates;
  const scene::Scene scene = scene::load_scene(take.set);
  begin(scene, take.observer);
  const std::uint64_t first = settings.still > 0 ? settings.last : 0;
  pipeline::TakeShots shots(take, {.first = first, .last = settings.last, .scene = &scene});
  render::DeviceOptions device;
  device.name = settings.device;
  pipeline::RenderStageOptions options;
  options.is_live = true;
  options.scale = settings.scale;
  pipeline::RenderStage stage(render::open_device(device), take.set, take.observer, scene, options);
  while (const std::optional<pipeline::Shot> next = shots.next())
    for (int i = 0; i < std::max(settings.still, 1); ++i) {
      pipeline::Shot shot = *next;
      const auto start = std::chrono::steady_clock::now();
      stage(shot);
      if (!shot.untouched.empty())
        throw Error(directory.string() + ": frame " + std::to_string(shot.index) +
                    " was not rendered: " + shot.untouched);
      LiveFrame frame;
      frame.index = shot.index;
      frame.is_last = i + 1 >= settings.still;
      frame.seconds =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      frame.picture = *shot.picture;
      frame.plate = *pipeline::plate_of(shot);
      frame.world_from_camera = shot.track.pose->world_from_camera;
      frame.exposure = take.set.observer.exposure.value_or(shot.frame->exposure);
      shown(frame);
    }
}

EstimatedFrame as_shown(const TruthFrame& truth, const Plate& picture) {
  const lighting::Response response(truth.response, picture.bits);
  EstimatedFrame out;
  for (const glm::dvec3& value : radiance_of(picture, response, truth.exposure))
    out.composite.emplace_back(value);
  out.mixed = out.diff = out.composite;
  for (std::size_t i = 0; i < out.diff.size(); ++i) out.diff[i] -= truth.plate[i];
  out.real = truth.real;
  out.mask = truth.mask;
  out.picture = picture;
  out.is_as_shown = true;
  return out;
}

double rms_of_difference(const TruthFrame& truth) {
  const glm::dvec3 white(1 / truth.exposure);
  double squares = 0;
  std::size_t values = 0;
  for (std::size_t i = 0; i < truth.mask.size(); ++i) {
    if (truth.mask[i] != 0) continue;
    const glm::dvec3 off = glm::clamp(glm::dvec3(truth.mixed[i]), glm::dvec3(0), white) -
                           glm::clamp(glm::dvec3(truth.real[i]), glm::dvec3(0), white);
    squares += glm::dot(off, off);
    values += 3;
  }
  return values > 0 ? std::sqrt(squares / static_cast<double>(values)) : 0;
}

}  // namespace previz::truth
