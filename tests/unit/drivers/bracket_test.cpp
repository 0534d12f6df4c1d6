#include "drivers/bracket.hpp"

#include "tests/support/test.hpp"

namespace previz::bracket_test {

using std::chrono::milliseconds;

// Applies an exposure to the next frame but one, and refuses what is longer than a second.
class Stand final : public Camera {
 public:
  std::string name() const override { return "stand"; }
  CameraFormat format() const override { return {}; }
  void start() override { streaming = true; }
  void stop() override { streaming = false; }
  bool set_exposure(double exposure_s, double gain) override {
    if (!drivable || exposure_s > 1) return false;
    EXPECT_EQ(gain, 1);
    wanted = exposure_s;
    return true;
  }
  CameraEvent next(milliseconds) override {
    auto frame = std::make_shared<Frame>();
    frame->exposure_s = applied;
    applied = wanted;
    return FramePtr(std::move(frame));
  }
  DeviceCounters counters() const override { return {}; }

  bool drivable = true, streaming = false;
  double wanted = 0.5, applied = 0.5;
};

double next_exposure(Camera& camera) {
  return std::get<FramePtr>(camera.next(milliseconds(0)))->exposure_s;
}

TEST(Bracket, AsksForTheNextAfterEveryFrame) {
  const auto camera = bracket(std::make_unique<Stand>(), {0.001, 0.01, 0.1});
  camera->start();
  EXPECT_EQ(next_exposure(*camera), 0.5);  // asked for too late to be the first
  for (const double exposure_s : {0.001, 0.01, 0.1, 0.001, 0.01})
    EXPECT_EQ(next_exposure(*camera), exposure_s);
  camera->stop();
  camera->start();
  next_exposure(*camera);
  EXPECT_EQ(next_exposure(*camera), 0.001);  // from the first on
}

TEST(Bracket, ACameraThatCannotBeDrivenIsAnError) {
  auto stand = std::make_unique<Stand>();
  stand->drivable = false;
  const auto camera = bracket(std::move(stand), {0.001});
  EXPECT_THROW(camera->start(), Error);
}

TEST(Bracket, AnExposureThatIsRefusedIsToldOnce) {
  const auto camera = bracket(std::make_unique<Stand>(), {0.001, 2.0});
  camera->start();
  int troubles = 0;
  for (int i = 0; i < 10; ++i)
    troubles += std::holds_alternative<DeviceTrouble>(camera->next(milliseconds(0)));
  EXPECT_EQ(troubles, 1);
}

}  // namespace previz::bracket_test
