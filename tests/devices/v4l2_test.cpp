// The V4L2 driver on a stand-in for the kernel: what is agreed, and what malformed buffers do. On
// real nodes it runs in the compliance suite.
#include "drivers/v4l2/find.hpp"
#include "drivers/v4l2/formats.hpp"
#include "drivers/v4l2/v4l2_camera.hpp"
#include "tests/devices/v4l2_fake_node.hpp"
#include "tests/support/test.hpp"

namespace previz::v4l2::v4l2_test {

using std::chrono::milliseconds;
using namespace std::chrono_literals;
using test::error_of;

CameraSettings settings() {
  CameraSettings settings;
  settings.device = "usb-cam";
  return settings;
}

std::unique_ptr<Camera> open(FakeDevice& device, const CameraSettings& wanted = settings()) {
  return open_v4l2(std::make_unique<FakeNode>(device), wanted, device.clock);
}

std::string refusal(FakeDevice& device, const CameraSettings& wanted = settings()) {
  return error_of([&] { open(device, wanted); });
}

// The words of a loss of the device, "" for any other event.
std::string loss_of(const CameraEvent& event) {
  const auto* trouble = std::get_if<DeviceTrouble>(&event);
  return trouble && trouble->lost ? trouble->what : "";
}

// ---- names

const std::vector<FoundNode> found{
    {"/dev/video0", "usb-Acme_Cam_S1-video-index0", "pci-0-usb-0:1:1.0-video-index0", "S1", "Acme"},
    {"/dev/video2", "", "platform-vivid.0-video-index0", "", "vivid"},
    {"/dev/video4", "usb-Acme_Cam_S2-video-index0", "pci-0-usb-0:2:1.0-video-index0", "S2", "Acme"},
    {"/dev/video6", "usb-Other_S2-video-index0", "pci-0-usb-0:3:1.0-video-index0", "S2", "Other"},
};

TEST(V4l2Find, ByEveryStableName) {
  for (const char* name : {"S1", "usb-Acme_Cam_S1-video-index0", "pci-0-usb-0:1:1.0-video-index0",
                           "/dev/v4l/by-id/usb-Acme_Cam_S1-video-index0",
                           "/dev/v4l/by-path/pci-0-usb-0:1:1.0-video-index0"})
    EXPECT_EQ(resolve(name, found), "/dev/video0");
  EXPECT_EQ(resolve("platform-vivid.0-video-index0", found), "/dev/video2");
  EXPECT_EQ(stable_name(found[0], found), "usb-Acme_Cam_S1-video-index0");
  EXPECT_EQ(stable_name(found[1], found), "platform-vivid.0-video-index0");
}

TEST(V4l2Find, NeverByNumber) {
  EXPECT_THAT(error_of([] { resolve("/dev/video2", found); }),
              HasSubstr("use the stable name \"platform-vivid.0-video-index0\""));
  EXPECT_THAT(error_of([] { resolve("/dev/video9", found); }), HasSubstr("number"));
}

TEST(V4l2Find, WhatIsNotThereOrNotOneIsAnError) {
  EXPECT_THAT(error_of([] { resolve("missing", found); }),
              HasSubstr("missing: not found; connected: usb-Acme_Cam_S1-video-index0"));
  EXPECT_THAT(error_of([] { resolve("missing", {}); }), HasSubstr("no cameras"));
  EXPECT_THAT(error_of([] { resolve("", found); }), HasSubstr("by-id"));
  EXPECT_THAT(error_of([] { resolve("S2", found); }), HasSubstr("two cameras"));
}

TEST(V4l2Find, TwinsWithoutASerialNumberAreToldApartByTheirPlaces) {
  const std::string id = "usb-Acme_Cam-video-index0";
  const std::vector<FoundNode> twins{
      {"/dev/video0", id, "pci-0-usb-0:1:1.0-video-index0", "", "Acme"},
      {"/dev/video2", id, "pci-0-usb-0:2:1.0-video-index0", "", "Acme"}};
  EXPECT_EQ(stable_name(twins[0], twins), "pci-0-usb-0:1:1.0-video-index0");
  EXPECT_THAT(error_of([&] { resolve(id, twins); }),
              AllOf(HasSubstr("usb-0:1:1.0"), HasSubstr("usb-0:2:1.0")));
  EXPECT_EQ(resolve("pci-0-usb-0:2:1.0-video-index0", twins), "/dev/video2");
}

// ---- formats

TEST(V4l2Formats, NamesComeBack) {
  EXPECT_EQ(fourcc_name(V4L2_PIX_FMT_YUYV), "YUYV");
  EXPECT_EQ(fourcc_name(V4L2_PIX_FMT_Y16), "Y16");
  EXPECT_EQ(fourcc_name(V4L2_PIX_FMT_Y16_BE), "Y16-BE");
  EXPECT_EQ(fourcc_of("Y16"), V4L2_PIX_FMT_Y16);
  EXPECT_EQ(fourcc_of("Y16-BE"), std::nullopt);
}

// The kernel's documentation, "Planar YUV formats": YU12 has Cb first, YV12 Cr.
TEST(V4l2Formats, PlanarPicturesOf420AreTakenInBothOrders) {
  EXPECT_EQ(wire_format(fourcc_of("YU12").value())->layout, convert::Layout::i420);
  EXPECT_EQ(wire_format(fourcc_of("YV12").value())->layout, convert::Layout::yv12);
  FakeDevice device;
  device.formats = {V4L2_PIX_FMT_YUV420};
  device.picture.pixelformat = V4L2_PIX_FMT_YUV420;
  EXPECT_EQ(open(device)->format(), (CameraFormat{PixelFormat::rgb8, 32, 24, 30}));
}

// The kernel's documentation, "Colorspaces": SRGB and JPEG default to BT.601, webcams send them.
TEST(V4l2Formats, ColourCodingsAreTheDriversOrV4l2sDefaults) {
  using convert::YuvMatrix, convert::YuvRange;
  v4l2_pix_format format{};
  format.pixelformat = V4L2_PIX_FMT_YUYV;
  const auto expect = [&](YuvMatrix matrix, YuvRange range) {
    EXPECT_EQ(wire_format(format)->matrix, matrix);
    EXPECT_EQ(wire_format(format)->range, range);
  };
  format.colorspace = V4L2_COLORSPACE_SRGB;
  expect(YuvMatrix::bt601, YuvRange::limited);
  format.colorspace = V4L2_COLORSPACE_JPEG;
  expect(YuvMatrix::bt601, YuvRange::full);
  format.colorspace = V4L2_COLORSPACE_REC709;
  expect(YuvMatrix::bt709, YuvRange::limited);
  format.ycbcr_enc = V4L2_YCBCR_ENC_601;
  format.quantization = V4L2_QUANTIZATION_FULL_RANGE;
  expect(YuvMatrix::bt601, YuvRange::full);
}

// ---- what is agreed

TEST(V4l2Configure, LeavesWhatIsNotAskedForAsItIs) {
  FakeDevice device;
  const CameraFormat format = open(device)->format();
  EXPECT_EQ(format, (CameraFormat{PixelFormat::rgb8, 32, 24, 30}));
  EXPECT_EQ(device.picture.pixelformat, V4L2_PIX_FMT_YUYV);
}

TEST(V4l2Configure, TakesTheFirstFormatThatCanBeConverted) {
  FakeDevice device;
  device.formats = {V4L2_PIX_FMT_H264, V4L2_PIX_FMT_UYVY};
  device.picture.pixelformat = V4L2_PIX_FMT_H264;
  open(device);
  EXPECT_EQ(device.picture.pixelformat, V4L2_PIX_FMT_UYVY);
  device.formats = {V4L2_PIX_FMT_H264};
  device.picture.pixelformat = V4L2_PIX_FMT_H264;
  EXPECT_EQ(refusal(device), "usb-cam: has no format that can be converted; it has: H264");
}

TEST(V4l2Configure, SetsFormatSizeRateAndControls) {
  FakeDevice device;
  device.add_control(V4L2_CID_EXPOSURE_AUTO, 0, 3, 3);
  device.add_control(V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0, 1, 1);
  device.add_control(V4L2_CID_EXPOSURE_ABSOLUTE, 3, 2047, 250);
  device.add_control(V4L2_CID_GAIN, 0, 255, 64);
  device.add_control(V4L2_CID_AUTO_WHITE_BALANCE, 0, 1, 1);
  device.add_control(V4L2_CID_WHITE_BALANCE_TEMPERATURE, 2800, 6500, 4000);
  CameraSettings wanted = settings();
  wanted.format = "MJPG";
  wanted.width = 16;
  wanted.height = 12;
  wanted.rate_hz = 15;
  wanted.exposure_s = 0.01;
  wanted.raw_gain = 20;
  wanted.white_balance_k = 5600;
  const auto camera = open(device, wanted);
  EXPECT_EQ(camera->format(), (CameraFormat{PixelFormat::rgb8, 16, 12, 15}));
  EXPECT_EQ(device.picture.pixelformat, V4L2_PIX_FMT_MJPEG);
  EXPECT_EQ(device.values[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(device.values[V4L2_CID_EXPOSURE_AUTO_PRIORITY], 0);
  EXPECT_EQ(device.values[V4L2_CID_EXPOSURE_ABSOLUTE], 100);
  EXPECT_EQ(device.values[V4L2_CID_GAIN], 20);
  EXPECT_EQ(device.values[V4L2_CID_AUTO_WHITE_BALANCE], 0);
  EXPECT_EQ(device.values[V4L2_CID_WHITE_BALANCE_TEMPERATURE], 5600);
}

TEST(V4l2Configure, WhatCannotBeSaysWhatCan) {
  FakeDevice device;
  const auto refused = [&](const auto& ask) {
    CameraSettings wanted = settings();
    ask(wanted);
    return refusal(device, wanted);
  };
  EXPECT_EQ(refused([](CameraSettings& wanted) {
              wanted.width = 640;
              wanted.height = 480;
            }),
            "usb-cam: offers YUYV 32x24 instead of YUYV 640x480; possible: 32x24, 16x12");
  EXPECT_EQ(refused([](CameraSettings& wanted) { wanted.format = "NV12"; }),
            "usb-cam: has no format NV12; it has: MJPG, YUYV");
  EXPECT_THAT(refused([](CameraSettings& wanted) { wanted.format = "nonsense"; }),
              HasSubstr("known: GREY"));
  EXPECT_EQ(refused([](CameraSettings& wanted) { wanted.exposure_s = 0.1; }),
            "usb-cam: its exposure cannot be set; remove exposure_s");
  EXPECT_THAT(refused([](CameraSettings& wanted) { wanted.white_balance_k = 5600; }),
              HasSubstr("remove white_balance_k"));
  EXPECT_THAT(refused([](CameraSettings& wanted) { wanted.gain = 2; }), HasSubstr("raw_gain"));
  EXPECT_THAT(refused([](CameraSettings& wanted) { wanted.trigger = "Line1"; }),
              HasSubstr("trigger"));
  device.add_control(V4L2_CID_WHITE_BALANCE_TEMPERATURE, 2800, 6500, 4000);
  EXPECT_THAT(refused([](CameraSettings& wanted) { wanted.white_balance_k = 9000; }),
              HasSubstr("2800 to 6500 are"));
}

TEST(V4l2Configure, WhatIsNoCameraIsRefused) {
  FakeDevice device;
  device.capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  EXPECT_THAT(refusal(device), HasSubstr("libcamera"));
  device.capabilities = V4L2_CAP_VIDEO_OUTPUT;
  EXPECT_THAT(refusal(device), HasSubstr("captures no video"));
  device.capabilities = V4L2_CAP_VIDEO_CAPTURE;
  EXPECT_THAT(refusal(device), HasSubstr("cannot stream"));
  device.capabilities |= V4L2_CAP_STREAMING;
  device.field = V4L2_FIELD_INTERLACED;
  EXPECT_THAT(refusal(device), HasSubstr("interlaced"));
  device.unplugged = true;
  EXPECT_THAT(refusal(device), HasSubstr("is not a video device"));
}

// ---- streaming

class V4l2Stream : public testing::Test {
 protected:
  void start(const CameraSettings& wanted = settings()) {
    camera_ = open(device_, wanted);
    camera_->start();
    ASSERT_TRUE(device_.streaming);
  }

  // Everything that is queued is looked at within less than a millisecond.
  FramePtr next() {
    CameraEvent event = camera_->next(1ms);
    auto* frame = std::get_if<FramePtr>(&event);
    return frame ? std::move(*frame) : nullptr;
  }

  std::uint64_t counted(const char* what) const {
    const DeviceCounters counters = camera_->counters();
    return counters.contains(what) ? counters.at(what) : 0;
  }

  bool all_buffers_are_queued() const {
    return std::ranges::all_of(device_.queued, [](bool queued) { return queued; });
  }

  FakeDevice device_;
  std::unique_ptr<Camera> camera_;
};

TEST_F(V4l2Stream, FramesComeWithTheKernelsTimes) {
  device_.extra_stride = 6;
  start();
  const std::int64_t time_ns = device_.now_ns / 1000 * 1000;
  device_.send(time_ns, 128);
  device_.send(time_ns + 1000, 129);
  const FramePtr first = next(), second = next();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->timestamp_ns, time_ns);
  EXPECT_GE(first->arrival_ns, first->timestamp_ns);
  EXPECT_EQ(second->sequence, first->sequence + 1);
  EXPECT_EQ(first->bytes.size(), 32u * 24 * 3);
  EXPECT_EQ(first->bytes[0], 130);  // (128 - 16) 255/219 = 130.4
  EXPECT_TRUE(all_buffers_are_queued());
  EXPECT_FALSE(next());
}

TEST_F(V4l2Stream, MalformedBuffersAreCountedAndLeftOut) {
  start();
  const std::int64_t time_ns = device_.now_ns - 1'000'000;
  device_.send(time_ns, 1, [](v4l2_buffer& buffer) { buffer.bytesused = 100; });
  device_.send(time_ns, 1, [](v4l2_buffer& buffer) { buffer.bytesused = 0; });
  device_.send(time_ns, 1, [](v4l2_buffer& buffer) { buffer.bytesused = 1u << 31; });
  device_.send(time_ns, 1, [](v4l2_buffer& buffer) { buffer.flags |= V4L2_BUF_FLAG_ERROR; });
  device_.send(time_ns, 7);
  const FramePtr whole = next();
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->sequence, 5u);  // four are missing before it
  EXPECT_EQ(counted("frames cut short"), 2u);
  EXPECT_EQ(counted("frames longer than their buffer"), 1u);
  EXPECT_EQ(counted("frames the device reports as damaged"), 1u);
  EXPECT_TRUE(all_buffers_are_queued());
  device_.send(time_ns, 1, [](v4l2_buffer& buffer) { buffer.index = 99; });
  EXPECT_FALSE(next());
  EXPECT_EQ(counted("unknown buffers"), 1u);
}

TEST_F(V4l2Stream, ABrokenClockOrCounterDoesNoHarm) {
  start();
  const std::int64_t time_ns = device_.now_ns - 10'000'000;
  device_.send(time_ns, 1);
  device_.send(time_ns, 1, [](v4l2_buffer& buffer) { buffer.sequence = 0; });
  device_.send(time_ns - 5'000'000, 1);
  device_.send(time_ns, 1, [](v4l2_buffer& buffer) { buffer.flags = 0; });
  FramePtr before = next();
  for (int i = 0; i < 3; ++i) {
    FramePtr frame = next();
    ASSERT_TRUE(frame);
    EXPECT_GT(frame->timestamp_ns, before->timestamp_ns);
    EXPECT_GT(frame->sequence, before->sequence);
    before = std::move(frame);
  }
  EXPECT_EQ(counted("frames without a kernel time stamp"), 1u);
}

TEST_F(V4l2Stream, ATimeBeyondAllNanosecondsIsReplacedByTheArrival) {
  start();
  constexpr std::int64_t least = std::numeric_limits<std::int64_t>::min();
  constexpr std::int64_t most = std::numeric_limits<std::int64_t>::max();
  std::int64_t before_ns = 0;
  for (const timeval time : {timeval{most, 0}, timeval{least, 0}, timeval{most, most},
                             timeval{least, least}, timeval{0, most}}) {
    device_.send(device_.now_ns, 1, [&](v4l2_buffer& buffer) { buffer.timestamp = time; });
    const FramePtr frame = next();
    ASSERT_TRUE(frame) << time.tv_sec << " s and " << time.tv_usec << " us";
    EXPECT_EQ(frame->timestamp_ns, frame->arrival_ns);
    EXPECT_GT(frame->timestamp_ns, before_ns);
    before_ns = frame->timestamp_ns;
  }
}

TEST_F(V4l2Stream, GapsInTheSequenceAreCounted) {
  start();
  for (const std::uint32_t sequence : {0u, 1u, 5u, 6u})
    device_.send(device_.now_ns, 1, [&](v4l2_buffer& buffer) { buffer.sequence = sequence; });
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(next());
  EXPECT_EQ(counted("frames missing in the sequence"), 3u);
}

TEST_F(V4l2Stream, NoFrameFromBeforeAStop) {
  start();
  device_.send(device_.now_ns, 1);
  const std::uint64_t first = next()->sequence;
  device_.send(device_.now_ns, 2);
  camera_->stop();
  EXPECT_FALSE(device_.streaming);
  EXPECT_EQ(device_.mapped, 0);
  EXPECT_TRUE(device_.memory.empty());
  camera_->start();
  EXPECT_FALSE(next());
  device_.send(device_.now_ns, 3);
  EXPECT_EQ(next()->sequence, first + 1);
  camera_.reset();
  EXPECT_EQ(device_.mapped, 0);
}

TEST_F(V4l2Stream, AnUnpluggedDeviceIsLostAndLetGo) {
  start();
  device_.unplugged = true;
  for (int i = 0; i < 2; ++i) EXPECT_EQ(loss_of(camera_->next(0ms)), "was unplugged");
  camera_.reset();
  EXPECT_EQ(device_.mapped, 0);
}

TEST_F(V4l2Stream, ErrorsInARowAreALoss) {
  start();
  device_.dequeue_errors.assign(9, EIO);
  device_.send(device_.now_ns, 1);
  EXPECT_TRUE(std::holds_alternative<FramePtr>(camera_->next(1000ms)));
  EXPECT_EQ(counted("read errors"), 9u);
  device_.dequeue_errors.assign(10, EIO);
  EXPECT_EQ(loss_of(camera_->next(1000ms)), "cannot be read: Input/output error");
}

TEST_F(V4l2Stream, WaitsAsLongAsItIsAskedTo) {
  start();
  for (const milliseconds asked : {30ms, 0ms}) {
    device_.waited_in_vain = 0ms;
    EXPECT_TRUE(std::holds_alternative<NoFrame>(camera_->next(asked)));
    EXPECT_EQ(device_.waited_in_vain, asked);
  }
}

// A damaged frame every 5 ms, the last of them at the deadline.
TEST_F(V4l2Stream, DamagedFramesWithoutEndDoNotMakeItWaitLonger) {
  start();
  device_.frames_to_come = 1000;
  device_.send_frame = [](FakeDevice& device) {
    device.send(0, 1, [](v4l2_buffer& buffer) { buffer.flags |= V4L2_BUF_FLAG_ERROR; });
  };
  const std::int64_t begin = device_.now_ns;
  EXPECT_TRUE(std::holds_alternative<NoFrame>(camera_->next(30ms)));
  EXPECT_LE(device_.now_ns, begin + 31'000'000);  // a wait is rounded up to milliseconds
  EXPECT_LE(device_.dequeued, 30 / 5);
  EXPECT_GE(device_.dequeued, 30 / 5 - 1);
  EXPECT_EQ(counted("frames the device reports as damaged"),
            static_cast<std::uint64_t>(device_.dequeued));
}

// Pictures of a bad cable: each takes 40 ms to decode and is damaged, and the next one waits
// already. The deadline is kept but for the last of them.
TEST_F(V4l2Stream, DamagedFramesThatWaitAlreadyDoNotMakeItWaitLonger) {
  start();
  device_.damages_all = true;
  device_.dequeue_time = 40ms;
  for (const int asked_ms : {0, 1, 100, 1000}) {
    const std::int64_t begin = device_.now_ns;
    EXPECT_TRUE(std::holds_alternative<NoFrame>(camera_->next(milliseconds(asked_ms))));
    EXPECT_LE(device_.now_ns - begin, (asked_ms + 41) * std::int64_t{1'000'000}) << asked_ms;
  }
  device_.damages_all = false;
  device_.send(device_.now_ns, 1);
  EXPECT_TRUE(next());
}

// ---- devices that grant less, or claim more, than can be

std::string refusal_to_start(FakeDevice& device) {
  return error_of([&] { open(device)->start(); });
}

TEST(V4l2Buffers, FewerThanAskedForAreEnoughIfThereAreTwo) {
  for (const std::uint32_t granted : {2u, 3u, 32u}) {
    FakeDevice device;
    device.buffers_granted = granted;
    const auto camera = open(device);
    camera->start();
    EXPECT_EQ(device.mapped, static_cast<int>(granted));
    for (std::uint32_t i = 0; i < 2 * granted; ++i) {
      device.send(device.now_ns, 1);
      EXPECT_TRUE(std::holds_alternative<FramePtr>(camera->next(1ms))) << i;
    }
    camera->stop();
    EXPECT_EQ(device.mapped, 0);
  }
}

TEST(V4l2Buffers, ANumberThatCannotBeIsRefused) {
  for (const std::uint32_t granted : {0u, 1u, 33u, 4'000'000'000u}) {
    FakeDevice device;
    device.buffers_granted = granted;
    EXPECT_THAT(refusal_to_start(device), HasSubstr("buffers")) << granted;
    EXPECT_EQ(device.mapped, 0);
    EXPECT_FALSE(device.streaming);
  }
}

TEST(V4l2Buffers, OfLengthsThatCannotBeAreRefusedAndOthersUsed) {
  for (const std::uint32_t length : {0u, 1u, 32u * 24 * 2 - 1}) {
    FakeDevice device;
    device.buffer_length = length;
    EXPECT_EQ(refusal_to_start(device), "usb-cam: returns buffers of " + std::to_string(length) +
                                            " bytes; a picture needs 1536");
    EXPECT_EQ(device.mapped, 0);
  }
  FakeDevice device;
  device.buffer_length = 0xffffffff;  // mapped as far as it is there
  EXPECT_EQ(refusal_to_start(device), "");
  EXPECT_EQ(device.mapped, 0);
}

TEST(V4l2Buffers, ThatCannotBeMappedOrQueuedLeaveNothingBehind) {
  for (const int good : {0, 1, 7}) {
    FakeDevice unmapped, unqueued;
    unmapped.most_mapped = static_cast<std::uint32_t>(good);
    EXPECT_EQ(refusal_to_start(unmapped),
              "usb-cam: a buffer cannot be mapped: Cannot allocate memory");
    unqueued.queues_until_error = good;
    EXPECT_EQ(refusal_to_start(unqueued),
              "usb-cam: a buffer cannot be queued: Cannot allocate memory");
    for (const FakeDevice* device : {&unmapped, &unqueued}) {
      EXPECT_EQ(device->mapped, 0);
      EXPECT_TRUE(device->memory.empty());
      EXPECT_FALSE(device->streaming);
    }
  }
}

TEST_F(V4l2Stream, ABufferThatCannotBeQueuedAgainIsALossAfterItsFrame) {
  device_.queues_until_error = 8;  // the first time
  start();
  device_.send(device_.now_ns, 1);
  EXPECT_TRUE(next());
  EXPECT_NE(loss_of(camera_->next(1ms)), "");
}

// What S_FMT makes of a size, as a driver with a mistake in it, or a hostile device, would.
TEST(V4l2Configure, FormatsThatCannotBeAreRefused) {
  struct Made {
    std::function<void(v4l2_pix_format&)> made;
    const char* why;
  };
  const std::vector<Made> all{
      {[](v4l2_pix_format& format) { format.width = 0; }, "which is impossible"},
      {[](v4l2_pix_format& format) { format.height = 0; }, "which is impossible"},
      {[](v4l2_pix_format& format) { format.width = 70'000; }, "which is impossible"},
      {[](v4l2_pix_format& format) { format.height = 0xffffffff; }, "which is impossible"},
      {[](v4l2_pix_format& format) { format.bytesperline = 1; }, "rows of 1 bytes; 64 are needed"},
      {[](v4l2_pix_format& format) { format.bytesperline = 0xffffffff; }, "bytes is the maximum"},
      {[](v4l2_pix_format& format) {
         format.width = format.height = 65'535;
         format.bytesperline = 4 * 65'536;
       },
       "bytes is the maximum"},
      {[](v4l2_pix_format& format) {
         format.pixelformat = V4L2_PIX_FMT_MJPEG;
         format.width = format.height = 65'535;
       },
       "65535x65535 pixels and 12884508675 bytes; 1073741824 bytes is the maximum"},
  };
  for (std::size_t i = 0; i < all.size(); ++i) {
    FakeDevice device;
    device.formats = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG};
    device.picture.pixelformat = i + 1 == all.size() ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV;
    device.format_made = all[i].made;
    EXPECT_THAT(refusal(device), HasSubstr(all[i].why)) << i;
  }
}

TEST(V4l2Configure, ARateOrBoundsThatCannotBeAreNotKnown) {
  FakeDevice device;
  device.period = {1, 0xffffffff};
  EXPECT_EQ(open(device)->format().rate_hz, 0);
  device.period = {0, 30};
  EXPECT_EQ(open(device)->format().rate_hz, 0);
  device.add_control(V4L2_CID_EXPOSURE_ABSOLUTE, 5000, 1, 100);  // the least is above the most
  EXPECT_FALSE(open(device)->set_exposure(0.01, 1));
  device.formats = {0x00ff00ff, 0x0a0d0907};
  device.picture.pixelformat = device.formats[0];
  EXPECT_EQ(refusal(device), "usb-cam: has no format that can be converted; it has: ????, ????");
}

// A grabber whose source changes its size.
TEST_F(V4l2Stream, AChangeOfTheSourceIsALossSoThatItIsOpenedAnew) {
  device_.has_events = true;
  start();
  device_.send(device_.now_ns, 1);
  EXPECT_TRUE(next());
  v4l2_event other{}, change{};
  other.type = V4L2_EVENT_SOURCE_CHANGE;  // of something else than the size
  device_.events = {other};
  device_.send(device_.now_ns, 1);
  EXPECT_TRUE(next());
  change.type = V4L2_EVENT_SOURCE_CHANGE;
  change.u.src_change.changes = V4L2_EVENT_SRC_CH_RESOLUTION;
  device_.events = {other, change};
  device_.send(device_.now_ns, 1);
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(loss_of(camera_->next(0ms)), "has changed its picture size");
}

// A driver whose events never end must not hold the camera up.
TEST_F(V4l2Stream, EventsWithoutEndDoNotKeepFramesBack) {
  device_.has_events = true;
  start();
  device_.events.assign(1000, v4l2_event{});
  device_.send(device_.now_ns, 1);
  EXPECT_TRUE(next());
  EXPECT_FALSE(device_.events.empty());
}

TEST_F(V4l2Stream, ExposuresAreOnTheFramesThatSurelyHaveThem) {
  device_.add_control(V4L2_CID_EXPOSURE_ABSOLUTE, 1, 5000, 100);
  device_.add_control(V4L2_CID_EXPOSURE_AUTO, 0, 3, 1);
  CameraSettings wanted = settings();
  wanted.responsivity = 10;
  start(wanted);
  device_.send(device_.now_ns, 1);
  const FramePtr before = next();
  EXPECT_DOUBLE_EQ(before->exposure_s, 0.01);
  EXPECT_DOUBLE_EQ(before->exposure, 0.1);
  EXPECT_TRUE(camera_->set_exposure(0.02, 1));
  EXPECT_EQ(device_.values[V4L2_CID_EXPOSURE_ABSOLUTE], 200);
  for (int i = 0; i < 4; ++i) {
    device_.send(device_.now_ns + 1000, 1);
    EXPECT_FALSE(next());
  }
  EXPECT_EQ(counted("frames during an exposure change"), 4u);
  device_.send(device_.now_ns + 1000, 1);
  EXPECT_DOUBLE_EQ(next()->exposure_s, 0.02);
  EXPECT_FALSE(camera_->set_exposure(0.02, 2));  // the gain has no unit
  EXPECT_FALSE(camera_->set_exposure(-1, 1));
}

}  // namespace previz::v4l2::v4l2_test
