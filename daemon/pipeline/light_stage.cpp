#include "daemon/pipeline/light_stage.hpp"

#include <utility>

#include "daemon/lighting/hdr.hpp"
#include "daemon/lighting/lighting.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {

LightStage::LightStage(const set::Set& set, std::optional<LightCameraCalibration> calibration)
    : settings_(set.lighting),
      exposure_(set.light_camera.exposure),
      calibration_(std::move(calibration)),
      given_(set.lighting.environment.has_value()) {
  if (given_)
    light_ = std::make_shared<const Light>(Light{lighting::load_environment(settings_), {}});
  else if (!calibration_)
    throw Error(set.file.string() +
                ": lighting: neither lighting.environment nor a light camera with a calibration is "
                "given; one of them must light the set");
}

void LightStage::use(set::LightMode mode) {
  if (settings_.mode == mode) return;
  settings_.mode = mode;
  changed_ = !newest_.empty();
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
    Light light;
    for (const auto& [exposure, frame] : newest_) {
      bracket.push_back(frame);
      light.sequences.push_back(frame->sequence);
    }
    light.lighting = lighting::estimate(bracket, *calibration_, settings_);
    light_ = std::make_shared<const Light>(std::move(light));
    changed_ = false;
  }
  return light_;
}

}  // namespace previz::pipeline
