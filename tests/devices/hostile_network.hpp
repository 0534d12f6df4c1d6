// A network with a camera and with hosts that mean harm.
#pragma once

#include <arv.h>

#include "drivers/camera_drivers.hpp"
#include "tests/devices/hostile_packets.hpp"
#include "tests/devices/private_network.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::test::aravis_hostile_test {

namespace fs = std::filesystem;
using namespace hostile;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t url_register = 0x200;  // where a camera says where its description is

struct UnrefFake {
  void operator()(gpointer object) const { g_object_unref(object); }
};

class HostileNetwork : public testing::Test {
 protected:
  void SetUp() override {
    const bool is_private = enter_private_network();  // the camera's control port is fixed
    plug();
    if (!fake_ && !is_private)
      GTEST_SKIP() << "Aravis' fake camera cannot listen on " << address
                   << ", and this process may have no network of its own";
    ASSERT_TRUE(fake_) << "Aravis' fake camera cannot listen on " << address;
  }
  void TearDown() override { EXPECT_EQ(std::to_string(receivers().size()), "0"); }

  void plug() {
    camera_.reset(arv_gv_fake_camera_new(address, "previz-hostile"));
    if (!arv_gv_fake_camera_is_running(camera_.get())) return;
    fake_ = arv_gv_fake_camera_get_fake_camera(camera_.get());
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_WIDTH, width);
    arv_fake_camera_write_register(fake_, ARV_FAKE_CAMERA_REGISTER_HEIGHT, height);
  }

  static std::unique_ptr<Camera> open() {
    CameraSettings settings;
    settings.device = address;
    settings.rate_hz = 40;
    settings.exposure_s = 0.01;
    settings.packet_size = packet_size;
    return camera_driver("aravis").open(settings);
  }

  static std::unique_ptr<Camera> open_streaming() {
    std::unique_ptr<Camera> camera = open();
    camera->start();
    EXPECT_TRUE(takes_a_frame(*camera));
    return camera;
  }

  // Takes a frame of the camera; false, with what was counted, if none comes within two seconds.
  static testing::AssertionResult takes_a_frame(Camera& camera) {
    for (const auto end = Clock::now() + seconds(2); Clock::now() < end;) {
      const CameraEvent event = camera.next(milliseconds(100));
      if (const auto* frame = std::get_if<FramePtr>(&event)) {
        if (std::ranges::count((*frame)->bytes, forged) == width * height)
          return testing::AssertionFailure() << "another host's frame";
        return testing::AssertionSuccess();
      }
      if (const auto* trouble = std::get_if<DeviceTrouble>(&event))
        return testing::AssertionFailure() << trouble->what;
    }
    return testing::AssertionFailure() << testing::PrintToString(camera.counters());
  }

  // Sends what is not wanted while frames come.
  static void expect_frames_among(const char* from) {
    const auto camera = open_streaming();
    const std::vector<pid_t> before = receivers();
    const std::vector<std::uint16_t> ports = udp_ports();
    const Sender sender(from);
    ASSERT_EQ(before.size(), 1u);
    ASSERT_GE(ports.size(), 2u);  // of the control channel and the stream
    const std::vector<Bytes> packets = unwanted(from);
    for (int i = 0; i < 2'000; ++i) {
      for (const Bytes& packet : packets) sender.send(packet, ports);
      if (i % 100 != 0) continue;
      ASSERT_TRUE(takes_a_frame(*camera)) << "in the flood";
    }
    for (int i = 0; i < 5; ++i) EXPECT_TRUE(takes_a_frame(*camera));
    EXPECT_EQ(receivers(), before) << "the receiver was ended";
  }

  std::unique_ptr<ArvGvFakeCamera, UnrefFake> camera_;
  ArvFakeCamera* fake_ = nullptr;  // the camera's
  TemporaryDirectory directory_;
};

}  // namespace previz::test::aravis_hostile_test
