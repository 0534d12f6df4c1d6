#include "daemon/pipeline/light_stage.hpp"

#include <algorithm>
#include <utility>

#include "daemon/lighting/hdr.hpp"
#include "daemon/lighting/light_mode.hpp"
#include "daemon/lighting/lighting.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

// Over which the shapes of sources are averaged.
constexpr double source_smoothing_s = 0.25;

}  // namespace

LightStage::LightStage(const set::Set& set, std::optional<LightCameraCalibration> calibration)
    : settings_(set.lighting),
      exposure_(set.light_camera.exposure),
      calibration_(std::move(calibration)),
      given_(set.lighting.environment.has_value()),
      tracker_(source_smoothing_s) {
  if (given_)
    light_ = finished(lighting::load_environment(settings_), {}, 0);
  else if (!calibration_)
    throw Error(set.file.string() +
                ": lighting: neither lighting.environment nor a light camera with a calibration is "
                "given; one of them must light the set");
}

void LightStage::use(set::LightMode mode) {
  if (settings_.mode == mode) return;
  settings_.mode = mode;
  if (given_) light_ = finished(lighting::load_environment(settings_), {}, 0);
  changed_ = !newest_.empty();
}

// The image's sources stand where the set says, seen from the camera; from the world's origin where
// the image is a file.
LightPtr LightStage::finished(lighting::Lighting lighting, std::vector<std::uint64_t> sequences,
                              std::int64_t timestamp_ns) {
  lighting::apply_mode(lighting, settings_, tracker_, timestamp_ns);
  const glm::dvec3 viewpoint =
      given_ ? glm::dvec3(0) : glm::dvec3(calibration_->world_from_camera[3]);
  std::vector<set::Light> lamps = lighting::lamps_of(lighting.sources, settings_, viewpoint);
  return std::make_shared<const Light>(
      Light{std::move(lighting), std::move(lamps), std::move(sequences)});
}

void LightStage::see(FramePtr frame, std::uint64_t index) {
  if (given_ || (settings_.frame >= 0 && index != static_cast<std::uint64_t>(settings_.frame)))
    return;
  if (exposure_) {
    auto exposed = std::make_shared<Frame>(*frame);
    exposed->exposure = *exposure_;
    frame = std::move(exposed);
  }
  newest_[lighting::exposure_step(frame->exposure)] = std::move(frame);
  changed_ = true;
}

LightPtr LightStage::light() {
  if (changed_) {
    std::vector<FramePtr> bracket;
    std::vector<std::uint64_t> sequences;
    std::int64_t newest_ns = 0;
    for (const auto& [exposure, frame] : newest_) {
      bracket.push_back(frame);
      sequences.push_back(frame->sequence);
      newest_ns = std::max(newest_ns, frame->timestamp_ns);
    }
    light_ = finished(lighting::estimate(bracket, *calibration_, settings_), std::move(sequences),
                      newest_ns);
    changed_ = false;
  }
  return light_;
}

}  // namespace previz::pipeline
