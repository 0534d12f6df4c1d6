#include "daemon/rig/camera_source.hpp"

#include <cmath>
#include <utility>
#include <variant>

namespace previz::rig {

CameraSource::CameraSource(Camera& camera, std::string stage, std::string crews_name, Parts parts)
    : camera_(camera),
      stage_(std::move(stage)),
      crews_name_(std::move(crews_name)),
      parts_(std::move(parts)),
      counts_(parts_.metrics, stage_) {}

FramePtr CameraSource::next() {
  const std::chrono::duration<double> silence(parts_.silence_s);
  while (!parts_.stop.stop_requested()) {
    CameraEvent event = camera_.next(std::chrono::milliseconds(100));
    counts_.update(camera_.counters());
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
  parts_.reports(report::once({.severity = report::Severity::error,
                               .source = trouble.device,
                               .text = trouble.what,
                               .notice = report::lasting(crews_name_, trouble.what)}));
  parts_.metrics.count(stage_ + ": device trouble");
  if (trouble.lost) lose();
}

void CameraSource::lose() {
  if (std::exchange(lost_, true)) return;
  if (parts_.presence) parts_.presence(true);
}

void CameraSource::arrived(const Frame& frame) {
  parts_.reports.settle(crews_name_);
  if (std::exchange(lost_, false) && parts_.presence) parts_.presence(false);
  if (last_sequence_ && frame.sequence > *last_sequence_ + 1)
    parts_.metrics.dropped(stage_, "by the device", frame.sequence - *last_sequence_ - 1);
  last_sequence_ = frame.sequence;
  last_ = std::chrono::steady_clock::now();
  exposure_s_ = frame.exposure_s;
  gain_ = frame.gain;
}

void CameraSource::change_exposure(double stops) {
  if (!(exposure_s_ > 0) || !camera_.set_exposure(exposure_s_ * std::exp2(stops), gain_))
    parts_.reports(report::once(
        {report::Severity::warning, camera_.name(), "its exposure cannot be driven from here"}));
}

}  // namespace previz::rig
