// A renderer that changes the size of its picture, as the frame rate asks: nothing is made anew,
// and the pictures are those of a renderer that was made for the size.
#include "daemon/core/render/device/device.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::test::resize_test {

// Returns the calibration of the same lens with fewer pixels.
ObserverCalibration smaller(ObserverCalibration calibration, int width, int height) {
  PinholeIntrinsics& lens = calibration.intrinsics;
  const double x = static_cast<double>(width) / lens.width;
  const double y = static_cast<double>(height) / lens.height;
  lens.width = width;
  lens.height = height;
  lens.fx *= x;
  lens.cx *= x;
  lens.fy *= y;
  lens.cy *= y;
  return calibration;
}

struct Pictures {
  Plate shown, denoised;
  render::Layers layers;
};

Pictures pictures_of(render::Renderer& renderer, const View& view, const PinholeIntrinsics& lens) {
  const Plate plate = random_plate(lens.width, lens.height, 8);
  renderer.begin({std::make_shared<const Plate>(plate), 0.85, view.world_from_camera});
  renderer.render(1);
  expect_clean(renderer.counters());
  return {renderer.show(false), renderer.show(true), renderer.layers()};
}

class ResizeOf : public ::testing::TestWithParam<set::RealRadiance> {};
INSTANTIATE_TEST_SUITE_P(RealRadiance, ResizeOf,
                         ::testing::Values(set::RealRadiance::traced, set::RealRadiance::camera));

TEST_P(ResizeOf, MakesNothingAnewAndChangesNoBit) {
  // More slots than a CPU has in flight: several tiles.
  const View view = random_scene(3, {.width = 401, .height = 352});
  const set::Estimation estimation{.real_radiance = GetParam(), .max_depth = 3};
  SetRenderer renderer(view, estimation);
  pictures_of(renderer, view, view.calibration.intrinsics);
  render::Device::Made before = shared_device()->made();
  for (const double scale : {std::sqrt(0.5), 0.9, 1.0}) {
    SCOPED_TRACE(scale);
    const ObserverCalibration calibration =
        smaller(view.calibration, static_cast<int>(std::lround(401 * scale)),
                static_cast<int>(std::lround(352 * scale)));
    renderer.resize(calibration);
    const Pictures pictures = pictures_of(renderer, view, calibration.intrinsics);
    EXPECT_EQ(shared_device()->made(), before);

    View resized = view;
    resized.calibration = calibration;
    SetRenderer fresh(resized, estimation);
    const Pictures expected = pictures_of(fresh, view, calibration.intrinsics);
    EXPECT_EQ(pictures.shown.samples, expected.shown.samples);
    EXPECT_EQ(pictures.denoised.samples, expected.denoised.samples);
    EXPECT_EQ(pictures.layers.mixed, expected.layers.mixed);
    EXPECT_EQ(pictures.layers.diff, expected.layers.diff);
    before = shared_device()->made();  // with what the fresh renderer made
  }
}

}  // namespace previz::test::resize_test
