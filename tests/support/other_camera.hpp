// Puts something around a camera that changes what it delivers.
#pragma once

#include "drivers/camera.hpp"
#include "tests/support/test.hpp"

namespace previz::test {

class OtherCamera : public Camera {
 public:
  // Gets what the camera's next() returned.
  using Change = std::function<CameraEvent(CameraEvent, Camera&)>;
  OtherCamera(std::unique_ptr<Camera> camera, Change change)
      : camera_(std::move(camera)), change_(std::move(change)) {}

  std::string name() const override { return camera_->name(); }
  CameraFormat format() const override { return camera_->format(); }
  void start() override { camera_->start(); }
  void stop() override { camera_->stop(); }
  CameraEvent next(std::chrono::milliseconds timeout) override {
    return change_(camera_->next(timeout), *camera_);
  }
  bool set_exposure(double exposure_s, double gain) override {
    return camera_->set_exposure(exposure_s, gain);
  }
  DeviceCounters counters() const override { return camera_->counters(); }

 private:
  std::unique_ptr<Camera> camera_;
  Change change_;
};

inline void put_around(std::unique_ptr<Camera>& camera, OtherCamera::Change change) {
  camera = std::make_unique<OtherCamera>(std::move(camera), std::move(change));
}

}  // namespace previz::test
