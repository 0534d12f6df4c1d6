// The V4L2 driver on a stand-in for the kernel: what it makes of the rate that a set asks for.
#include "drivers/v4l2/v4l2_camera.hpp"
#include "tests/devices/v4l2_fake_node.hpp"
#include "tests/support/test.hpp"

namespace previz::v4l2::v4l2_rate_test {

CameraSettings asking(double rate_hz) {
  CameraSettings settings;
  settings.device = "usb-cam";
  settings.rate_hz = rate_hz;
  return settings;
}

std::unique_ptr<Camera> open(FakeDevice& device, const CameraSettings& wanted) {
  return open_v4l2(std::make_unique<FakeNode>(device), wanted, device.clock);
}

// A C920 at 1080p: YUYV takes 5 frames a second over USB 2, and MJPG 30.
TEST(V4l2Configure, TakesACompressedFormatWhereOnlyThatHoldsTheRate) {
  FakeDevice device;
  device.rates = {{V4L2_PIX_FMT_YUYV, {5, 2}}, {V4L2_PIX_FMT_MJPEG, {30, 15}}};
  const auto camera = open(device, asking(30));
  EXPECT_EQ(device.picture.pixelformat, V4L2_PIX_FMT_MJPEG);
  EXPECT_EQ(camera->format().rate_hz, 30);
  EXPECT_TRUE(camera->doubts().empty());

  FakeDevice slow;
  slow.rates = device.rates;
  open(slow, asking(5));
  EXPECT_EQ(slow.picture.pixelformat, V4L2_PIX_FMT_YUYV);
}

TEST(V4l2Configure, SaysWhichRatesThereAreWhereNoneHolds) {
  FakeDevice device;
  device.rates = {{V4L2_PIX_FMT_YUYV, {5, 2}}, {V4L2_PIX_FMT_MJPEG, {30, 15}}};
  CameraSettings wanted = asking(50);
  const auto camera = open(device, wanted);
  EXPECT_EQ(device.picture.pixelformat, V4L2_PIX_FMT_YUYV);
  EXPECT_THAT(
      camera->doubts(),
      ElementsAre(
          "rate_hz 50 is not possible; the camera sends 5 frames per second; allowed: 30, 15 "
          "(pixel_format MJPG), 5, 2 (pixel_format YUYV) at 32x24; change rate_hz or remove it; a "
          "smaller picture may be faster"));
  // What the set names is taken, whatever its rate.
  wanted.rate_hz = 30;
  wanted.format = "YUYV";
  FakeDevice named;
  named.rates = device.rates;
  EXPECT_EQ(open(named, wanted)->format().rate_hz, 5);
}

// A driver that has every rate between two of them, as industrial cameras do.
TEST(V4l2Configure, SaysBetweenWhichRatesItHasAll) {
  FakeDevice device;
  device.formats = {V4L2_PIX_FMT_YUYV};
  device.rates = {{V4L2_PIX_FMT_YUYV, {60, 1}}};
  device.has_rates_between = true;
  const auto camera = open(device, asking(120));
  EXPECT_EQ(camera->format().rate_hz, 60);
  ASSERT_EQ(camera->doubts().size(), 1u);
  EXPECT_EQ(camera->doubts()[0],
            "rate_hz 120 is not possible; the camera sends 60 frames per second; allowed: 1 to 60 "
            "(pixel_format YUYV) at 32x24; change rate_hz or remove it; a smaller picture may be "
            "faster");
  EXPECT_TRUE(open(device, asking(23.976))->doubts().empty());
}

TEST(V4l2Configure, ARateThatNoDeviceHasIsRefusedWithThoseOnOffer) {
  FakeDevice device;
  device.rates = {{V4L2_PIX_FMT_YUYV, {5, 2}}};
  for (const auto& [rate_hz, text] : {std::pair{-1.0, "-1"}, std::pair{1e6, "1e+06"}})
    EXPECT_EQ(test::error_of([&, wanted = asking(rate_hz)] { open(device, wanted); }),
              "usb-cam: rate_hz " + std::string(text) +
                  " is not possible; allowed: 5, 2 (pixel_format YUYV) at 32x24; "
                  "change rate_hz or remove it");
}

}  // namespace previz::v4l2::v4l2_rate_test
