#include "daemon/core/lighting/lighting.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "daemon/core/lighting/bracket.hpp"
#include "daemon/core/lighting/expansion.hpp"
#include "daemon/core/lighting/hdr.hpp"
#include "daemon/core/lighting/resampling.hpp"
#include "daemon/core/lighting/smoothing.hpp"
#include "daemon/core/lighting/unseen.hpp"
#include "daemon/core/lighting/vignetting.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::lighting {
namespace {

constexpr double sphere_sr = 4 * std::numbers::pi;

void check_size(std::span<const FramePtr> frames, const FisheyeIntrinsics& intrinsics) {
  for (const FramePtr& frame : frames) {
    if (frame->width != intrinsics.width || frame->height != intrinsics.height)
      throw Error(fmt::format(
          "light frame {} has {}x{} pixels, the light camera's calibration {}x{}", frame->sequence,
          frame->width, frame->height, intrinsics.width, intrinsics.height));
  }
}

// If this share of the camera's view is lost, the camera sees nothing that matters.
constexpr double blinded = 0.5;

// Returns what a user should know about this bracket, in plain words.
std::vector<std::string> describe(std::span<const FramePtr> frames, const Bracket& bracket,
                                  const Fisheye& lens, const EnvironmentReport& report,
                                  const set::Lighting& settings) {
  std::vector<std::string> notes;
  const auto [shortest, longest] = std::minmax_element(
      frames.begin(), frames.end(),
      [](const FramePtr& a, const FramePtr& b) { return a->exposure < b->exposure; });
  if (lens.max_angle_rad() < lens.intrinsics().max_angle_rad)
    notes.push_back(fmt::format(
        "the lens polynomial folds back at {:.1f} degrees off axis and is used only up to there",
        lens.max_angle_rad() * 180 / std::numbers::pi));
  const auto begin = [&](double sr) {
    if (sr > blinded * report.seen_sr)
      return fmt::format("the light camera is blinded: {:.0f} % of its view is",
                         100 * sr / report.seen_sr);
    return area_words(sr) + " is";
  };
  if (report.overexposed_sr > 0)
    notes.push_back(
        fmt::format("{} clipped in every exposure; the light there is {}; an exposure below {:.3g} "
                    "is needed to see it",
                    begin(report.overexposed_sr),
                    settings.clipped_gain > 1
                        ? fmt::format("assumed to be up to {:g} times white", settings.clipped_gain)
                        : "a lower bound",
                    (*shortest)->exposure));
  if (report.underexposed_sr > 0)
    notes.push_back(
        fmt::format("{} black in every exposure; an exposure above {:.3g} is needed to see it",
                    begin(report.underexposed_sr), (*longest)->exposure));
  for (const Disagreement& d : disagreements(bracket))
    notes.push_back(
        fmt::format("light frames {} and {} disagree by {:.1f} stops everywhere: an exposure is "
                    "reported wrongly, "
                    "or nearly all of the light changed between them; the newer one is used",
                    d.shorter, d.longer, std::abs(d.stops)));
  if (report.moved_sr > 0)
    notes.push_back(fmt::format(
        "{} changed between the exposures of the bracket; the newest exposure is used there",
        area_words(report.moved_sr)));
  if (report.filled_sr > 0)
    notes.push_back(
        fmt::format("the light camera cannot see {:.1f} % of all directions; they are filled by "
                    "the rule \"{}\"",
                    100 * report.filled_sr / sphere_sr, set::name_of(settings.unseen)));
  return notes;
}

}  // namespace

namespace {

// Scales the light camera's radiance to the film camera's.
void apply_balance(const glm::dvec3& balance, HdrPicture& picture) {
  if (balance == glm::dvec3(1)) return;
  const glm::vec3 factor(balance);
  for (glm::vec3& radiance : picture.radiance) radiance *= factor;
  for (glm::vec3& variance : picture.variance) variance *= factor * factor;
}

}  // namespace

struct Estimator::Impl {
  Impl(const LightCameraCalibration& its_calibration, const set::Lighting& its_settings,
       std::shared_ptr<const Room> room)
      : calibration(its_calibration),
        settings(its_settings),
        lens(calibration.intrinsics),
        viewpoint(calibration.world_from_camera, std::move(room)),
        size(chosen_resolution(settings.resolution, lens.axis_pixel_sr())),
        gains(vignetting_gains(lens, calibration.vignetting)),
        resampling(make_resampling(lens, viewpoint, size)),
        smoothing(settings.smoothing_s) {
    if (settings.unseen == set::UnseenRule::mirror)
      mirrored = make_resampling(lens, viewpoint.mirrored(), size);
  }

  const LightCameraCalibration calibration;
  const set::Lighting settings;
  const Fisheye lens;
  const Viewpoint viewpoint;
  const int size;
  const std::vector<float> gains;
  const Resampling resampling;
  std::optional<Resampling> mirrored;
  Smoothing smoothing;
};

Estimator::Estimator(const LightCameraCalibration& calibration, const set::Lighting& settings,
                     std::shared_ptr<const Room> room)
    : impl_(std::make_unique<Impl>(calibration, settings, std::move(room))) {}

Estimator::~Estimator() = default;

int Estimator::resolution() const {
  return impl_->size;
}

Lighting Estimator::operator()(std::span<const FramePtr> frames, const ObservedLight* observed) {
  Impl& my = *impl_;
  check_size(frames, my.calibration.intrinsics);
  const Bracket bracket(frames, my.calibration.response, my.calibration.dark_level);
  HdrPicture picture = merge(bracket);
  expand_clipped(picture, my.settings.clipped_gain);
  undo_vignetting(my.gains, picture);
  apply_balance(my.settings.balance, picture);
  my.smoothing(picture, bracket.newest_ns());
  Resampled map = resample(my.resampling, picture);

  Lighting lighting;
  EnvironmentReport& report = lighting.report;
  for (const float seen : map.seen) report.seen_sr += seen * texel_sr(my.size);
  report.filled_sr = std::max(0.0, sphere_sr - report.seen_sr);
  report.overexposed_sr = map.overexposed_sr;
  report.underexposed_sr = map.underexposed_sr;
  report.moved_sr = map.moved_sr;
  report.notes = describe(frames, bracket, my.lens, report, my.settings);
  std::optional<Resampled> mirror_image;
  if (my.mirrored) mirror_image = resample(*my.mirrored, picture);
  const Resampled* elsewhere = mirror_image ? &*mirror_image
                               : observed   ? &observed->map()
                                            : nullptr;
  fill_unseen(picture, my.lens, my.viewpoint, my.settings, elsewhere, map, report.notes);
  lighting.environment = {my.size, std::move(map.radiance)};
  return lighting;
}

Lighting estimate(std::span<const FramePtr> frames, const LightCameraCalibration& calibration,
                  const set::Lighting& settings, std::shared_ptr<const Room> room) {
  return Estimator(calibration, settings, std::move(room))(frames);
}

}  // namespace previz::lighting
