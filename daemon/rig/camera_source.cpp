#include "daemon/rig/camera_source.hpp"

#include <cmath>
#include <utility>
#include <variant>

namespace previz::rig {

CameraSource::CameraSource(Camera& camera, std::string stage, std::string crews_name, Told told)
    : camera_(camera),
      stage_(std::move(stage)),
      crews_name_(std::move(crews_name)),
      told_(std::move(told)),
      counts_(told_.metrics, stage_) {}

FramePtr CameraSource::next() {
  const std::chrono::duration<double> silence(told_.silence_s);
  while (!told_.stop.stop_requested()) {
    CameraEvent event = camera_.next(std::chrono::milliseconds(100));
    counts_.tell(camera_.counters());
    if (std::holds_alternative<EndOfStream>(event)) return nullptr;
    if (const auto* what = std::get_if<DeviceTrouble>(&event)) {
      trouble(*what);
    } else if (auto* frame = std::get_if<FramePtr>(&event)) {
      arrived(**frame);
      return std::move(*frame);
    }
    if (std::chrono::steady_clock::now() - last_ > silence) lose();
  }
  return nullptr;
}

void CameraSource::trouble(const DeviceTrouble& trouble) {
  told_.note(trouble.device + ": " + trouble.what);
  told_.metrics.count(stage_ + ": device trouble");
  told_.faults.tell(crews_name_, trouble.what);
  if (trouble.lost) lose();
}

void CameraSource::lose() {
  if (std::exchange(lost_, true)) return;
  if (told_.presence) told_.presence(true);
}

void CameraSource::arrived(const Frame& frame) {
  told_.faults.well(crews_name_);
  if (std::exchange(lost_, false) && told_.presence) told_.presence(false);
  if (last_sequence_ && frame.sequence > *last_sequence_ + 1)
    told_.metrics.dropped(stage_, "by the device", frame.sequence - *last_sequence_ - 1);
  last_sequence_ = frame.sequence;
  last_ = std::chrono::steady_clock::now();
  exposure_s_ = frame.exposure_s;
  gain_ = frame.gain;
}

void CameraSource::change_exposure(double stops) {
  if (!(exposure_s_ > 0) || !camera_.set_exposure(exposure_s_ * std::exp2(stops), gain_))
    told_.note(camera_.name() + ": its exposure cannot be driven from here");
}

}  // namespace previz::rig
