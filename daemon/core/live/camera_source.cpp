#include "daemon/core/live/camera_source.hpp"

#include <cmath>
#include <exception>
#include <thread>
#include <utility>
#include <variant>

namespace previz::live {

CameraSource::CameraSource(Camera& camera, std::string stage, std::string crews_name, Parts parts)
    : camera_(camera),
      stage_(std::move(stage)),
      crews_name_(std::move(crews_name)),
      parts_(std::move(parts)),
      counts_(parts_.kept.metrics, stage_),
      pulse_(parts_.kept.liveness, stage_) {}

FramePtr CameraSource::next() {
  while (!parts_.stop.stop_requested() && !has_ended_)
    if (FramePtr frame = ask()) return frame;
  return nullptr;
}

FramePtr CameraSource::ask() {
  FramePtr frame;
  try {
    pulse_.begin(parts_.kept.patience.camera);
    CameraEvent event = camera_.next(std::chrono::milliseconds(100));
    pulse_.wait();
    if (auto* captured = std::get_if<FramePtr>(&event)) frame = std::move(*captured);
    has_ended_ = std::holds_alternative<EndOfStream>(event);
    counts_.update(camera_.counters());
    if (has_ended_) return nullptr;
    if (const auto* what = std::get_if<DeviceTrouble>(&event)) trouble(*what, true);
    if (frame) arrived(*frame);
    if (!frame) look_at_silence();
  } catch (const std::exception& error) {
    failed(std::string("has failed: ") + error.what() + "; trying again");
  }
  return frame;
}

void CameraSource::look_at_silence() {
  const std::chrono::duration<double> longest(parts_.silence_s);
  if (std::chrono::steady_clock::now() - last_ > longest) lose();
}

void CameraSource::failed(const std::string& what) {
  pulse_.wait();
  try {
    trouble({camera_.name(), what, false}, false);
    look_at_silence();
  } catch (const std::exception&) {
    // Memory may be short; what is asked again will be reported again.
  }
  // Without a growing delay, because what the camera delivers is recorded.
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
}

void CameraSource::trouble(const DeviceTrouble& trouble, bool is_event) {
  const report::Report report{.severity = report::Severity::error,
                              .source = trouble.device,
                              .text = trouble.what,
                              .notice = report::lasting(crews_name_, trouble.what)};
  parts_.kept.reports(is_event ? report::counted(report) : report::once(report));
  parts_.kept.metrics.count(stage_ + ": device trouble");
  if (trouble.lost) lose();
}

void CameraSource::lose() {
  if (std::exchange(lost_, true)) return;
  if (parts_.presence) parts_.presence(true);
}

void CameraSource::arrived(const Frame& frame) {
  parts_.kept.reports.settle(crews_name_);
  if (std::exchange(lost_, false) && parts_.presence) parts_.presence(false);
  if (last_sequence_ && frame.sequence > *last_sequence_ + 1)
    parts_.kept.metrics.dropped(stage_, "by the device", frame.sequence - *last_sequence_ - 1);
  last_sequence_ = frame.sequence;
  last_ = std::chrono::steady_clock::now();
  exposure_s_ = frame.exposure_s;
  gain_ = frame.gain;
}

void CameraSource::change_exposure(double stops) {
  try {
    pulse_.begin(parts_.kept.patience.camera);
    const bool is_driven =
        exposure_s_ > 0 && camera_.set_exposure(exposure_s_ * std::exp2(stops), gain_);
    pulse_.wait();
    if (!is_driven)
      parts_.kept.reports(report::once(
          {report::Severity::warning, camera_.name(), "its exposure cannot be controlled"}));
  } catch (const std::exception& error) {
    failed(std::string("its exposure cannot be set: ") + error.what());
  }
}

}  // namespace previz::live
