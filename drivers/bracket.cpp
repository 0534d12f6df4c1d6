#include "drivers/bracket.hpp"

#include <cmath>
#include <utility>

#include "drivers/error.hpp"

namespace previz {
namespace {

class Bracket final : public Camera {
 public:
  Bracket(std::unique_ptr<Camera> camera, std::vector<double> exposures_s)
      : camera_(std::move(camera)), exposures_s_(std::move(exposures_s)) {}

  std::string name() const override { return camera_->name(); }
  CameraFormat format() const override { return camera_->format(); }
  std::vector<std::string> doubts() const override { return camera_->doubts(); }
  DeviceCounters counters() const override { return camera_->counters(); }
  void stop() override { camera_->stop(); }
  bool set_exposure(double, double) override { return false; }

  void start() override {
    next_ = 0;
    if (!advance()) throw Error(name() + ": its exposure cannot be controlled; remove bracket_s");
    camera_->start();
  }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    if (std::exchange(refused_, false))
      return DeviceTrouble{name(), "rejects an exposure of its bracket"};
    CameraEvent event = camera_->next(timeout);
    if (std::holds_alternative<FramePtr>(event) && !advance() && !std::exchange(reported_, true))
      refused_ = true;
    return event;
  }

 private:
  bool advance() {
    const double exposure_s = exposures_s_[next_];
    next_ = (next_ + 1) % exposures_s_.size();
    return camera_->set_exposure(exposure_s, 1);
  }

  std::unique_ptr<Camera> camera_;
  const std::vector<double> exposures_s_;
  std::size_t next_ = 0;
  bool refused_ = false;  // the camera refused an exposure, which next() has not reported yet
  bool reported_ = false;
};

}  // namespace

std::unique_ptr<Camera> bracket(std::unique_ptr<Camera> camera, std::vector<double> exposures_s) {
  return std::make_unique<Bracket>(std::move(camera), std::move(exposures_s));
}

long exposure_step(double exposure) {
  return std::lround(std::log(exposure) / std::log1p(0.01));
}

}  // namespace previz
