#include "daemon/lighting/lighting.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "daemon/lighting/hdr.hpp"
#include "daemon/lighting/resampling.hpp"
#include "daemon/lighting/unseen.hpp"
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

glm::dmat3 rotation_of(const glm::dmat4& world_from_camera) {
  const glm::dmat3 rotation(world_from_camera);
  const glm::dmat3 residual = glm::transpose(rotation) * rotation - glm::dmat3(1);
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r)
      if (!(std::abs(residual[c][r]) < 1e-4) || !(glm::determinant(rotation) > 0))
        throw Error("light camera: world_from_camera is not a rotation and a translation");
  return rotation;
}

const char* to_string(set::UnseenRule rule) {
  switch (rule) {
    case set::UnseenRule::constant:
      return "constant";
    case set::UnseenRule::horizon:
      return "horizon";
    case set::UnseenRule::mirror:
      return "mirror";
  }
  return "";
}

// What a user should know about this bracket, in plain words.
std::vector<std::string> describe(std::span<const FramePtr> frames, const Fisheye& lens,
                                  const EnvironmentReport& report, const set::Lighting& settings) {
  std::vector<std::string> notes;
  const auto [shortest, longest] = std::minmax_element(
      frames.begin(), frames.end(),
      [](const FramePtr& a, const FramePtr& b) { return a->exposure < b->exposure; });
  if (lens.max_angle_rad() < lens.intrinsics().max_angle_rad)
    notes.push_back(fmt::format(
        "the lens polynomial turns back at {:.1f} degrees off axis and is used up to there only",
        lens.max_angle_rad() * 180 / std::numbers::pi));
  if (report.overexposed_sr > 0)
    notes.push_back(fmt::format(
        "{:.4f} sr are clipped in every exposure, the light there is a lower bound; an exposure "
        "below {:.3g} is needed",
        report.overexposed_sr, (*shortest)->exposure));
  if (report.underexposed_sr > 0)
    notes.push_back(fmt::format(
        "{:.4f} sr are black in every exposure; an exposure above {:.3g} would see there",
        report.underexposed_sr, (*longest)->exposure));
  if (report.filled_sr > 0)
    notes.push_back(fmt::format("{:.3f} sr ({:.1f} %) are unseen and filled by the rule \"{}\"",
                                report.filled_sr, 100 * report.filled_sr / sphere_sr,
                                to_string(settings.unseen)));
  return notes;
}

}  // namespace

Lighting estimate(std::span<const FramePtr> frames, const LightCameraCalibration& calibration,
                  const set::Lighting& settings) {
  const Fisheye lens(calibration.intrinsics);
  check_size(frames, calibration.intrinsics);
  const glm::dmat3 world_from_camera = rotation_of(calibration.world_from_camera);
  const int size = chosen_resolution(settings.resolution, lens.axis_pixel_sr());

  const HdrPicture picture = merge_exposures(frames, calibration.response);
  Resampled map = resample(make_resampling(lens, world_from_camera, size), picture);

  Lighting lighting;
  EnvironmentReport& report = lighting.report;
  for (const float seen : map.seen) report.seen_sr += seen * texel_sr(size);
  report.filled_sr = std::max(0.0, sphere_sr - report.seen_sr);
  report.overexposed_sr = map.overexposed_sr;
  report.underexposed_sr = map.underexposed_sr;
  report.notes = describe(frames, lens, report, settings);
  fill_unseen(picture, lens, world_from_camera, settings, map, report.notes);
  lighting.environment = {size, std::move(map.radiance)};
  return lighting;
}

}  // namespace previz::lighting
