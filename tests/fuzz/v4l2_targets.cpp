// What a V4L2 driver answers: the driver of this project runs on the stand-in for the kernel that
// its own tests use, and the bytes change its answers, field by field. Then either the camera is
// refused, or what it delivers has the size that it reports.
#include <algorithm>
#include <cstring>
#include <iterator>
#include <map>

#include "drivers/convert/convert.hpp"
#include "drivers/error.hpp"
#include "drivers/v4l2/v4l2_camera.hpp"
#include "tests/devices/v4l2_fake_node.hpp"
#include "tests/fuzz/targets.hpp"
#include "tests/support/session_fixture.hpp"

namespace previz::fuzz {
namespace v4l2_targets_cpp {

constexpr std::uint32_t words[] = {
    0,     1,      2,          15,         16,         32,        255,        65'535,
    65536, 70'000, 0x10000000, 0x7fffffff, 0x80000000, 0xfffffff, 0xfffffffe, 0xffffffff};
constexpr int errors[] = {EINVAL, EIO, ENODEV, ENOMEM, EAGAIN, EBUSY, ENOTTY, EPIPE};
constexpr std::uint32_t known_formats[] = {
    V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_UYVY,    V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_NV12,
    V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_RGB24,   V4L2_PIX_FMT_BGR24, V4L2_PIX_FMT_SRGGB10P,
    V4L2_PIX_FMT_Y10,  V4L2_PIX_FMT_SGRBG12, V4L2_PIX_FMT_Y16,   V4L2_PIX_FMT_H264};
// More than one picture of a sane device has, and little enough to be mapped often.
constexpr std::size_t most_mapped_bytes = std::size_t{1} << 20;

// Answers as the stand-in does, and changes the answers as the bytes say. Its buffers are of its
// own memory, as long as they are claimed to be, so that the sanitizer sees what is read beyond.
class LyingNode final : public v4l2::Node {
 public:
  LyingNode(v4l2::FakeDevice& device, Choices& choices) : node_(device), choices_(choices) {}
  ~LyingNode() override { expect(mapped_.empty(), "no buffer is left mapped"); }

  bool wait(std::chrono::milliseconds timeout) override { return node_.wait(timeout); }

  std::span<const std::uint8_t> map(std::size_t, std::size_t length) override {
    if (length == 0 || length > most_mapped_bytes) {
      errno = length == 0 ? EINVAL : ENOMEM;
      return {};
    }
    std::vector<std::uint8_t> memory(length, 0x80);
    std::copy_n(picture_.begin(), std::min(length, picture_.size()), memory.begin());
    const std::span<const std::uint8_t> span = memory;
    mapped_[span.data()] = std::move(memory);
    return span;
  }
  void unmap(std::span<const std::uint8_t> memory) override {
    const auto found = mapped_.find(memory.data());
    expect(found != mapped_.end() && found->second.size() == memory.size(),
           "what is unmapped was mapped");
    mapped_.erase(found);
  }

  int control(unsigned long request, void* argument) override {
    const int result = node_.control(request, argument);
    const std::uint8_t lies = choices_.byte();
    if (lies < 128) return result;
    if (lies >= 248) return errors[lies % std::size(errors)];
    for (int times = 0; times <= lies % 3; ++times)
      change_field(static_cast<std::uint8_t*>(argument), _IOC_SIZE(request));
    return 0;
  }

 private:
  // Every field of V4L2's structures begins at a multiple of four bytes.
  void change_field(std::uint8_t* answer, std::size_t size) {
    const std::size_t at = choices_.byte() * 4u % (size / 4 * 4);
    const std::uint8_t kind = choices_.byte();
    std::uint32_t word = words[kind % std::size(words)];
    if (kind >= 128) word = static_cast<std::uint32_t>(choices_.up_to(65'535));
    if (kind >= 240) word = known_formats[kind % std::size(known_formats)];
    std::memcpy(answer + at, &word, sizeof word);
  }

  v4l2::FakeNode node_;
  Choices& choices_;
  std::map<const std::uint8_t*, std::vector<std::uint8_t>> mapped_;
  const std::string picture_ =
      session::content_of(std::filesystem::path(PREVIZ_SOURCE_DIR) /
                          "tests/fuzz/corpus/mjpeg/baseline.jpg");  // 48x32, for MJPEG
};

void set_up(v4l2::FakeDevice& device, Choices& choices) {
  const std::uint8_t has = choices.byte();
  device.sizes = {{48, 32}, {32, 24}};
  device.formats = {known_formats[choices.byte() % std::size(known_formats)],
                    known_formats[choices.byte() % std::size(known_formats)]};
  device.picture.pixelformat = device.formats[0];
  device.picture.width = 48;
  device.picture.height = 32;
  device.extra_stride = choices.byte();
  device.has_events = has & 1;
  device.has_rates_between = has & 2;
  if (has & 4) device.rates[device.formats[0]] = {30, choices.byte()};
  if (has & 8) device.buffers_granted = choices.byte() % 36;
  if (has & 16) device.add_control(V4L2_CID_EXPOSURE_ABSOLUTE, 1, 1000, 100);
  if (has & 32) device.add_control(V4L2_CID_GAIN, 0, choices.byte(), 1);
  if (has & 64) device.has_events = true;
}

CameraSettings settings_of(Choices& choices) {
  CameraSettings settings;
  settings.device = "usb-cam";
  const std::uint8_t has = choices.byte();
  if (has & 1) settings.width = 48, settings.height = 32;
  if (has & 2) settings.rate_hz = choices.byte();
  if (has & 4) settings.exposure_s = choices.byte() * 1e-3;
  if (has & 8) settings.raw_gain = choices.byte();
  if (has & 16) settings.white_balance_k = 5000;
  if (has & 32) settings.format = "MJPG";
  return settings;
}

struct Last {
  std::uint64_t sequence = 0;
  std::int64_t timestamp_ns = 0;
};

void check_frame(const Frame& frame, const CameraFormat& format, Last& last) {
  expect(
      frame.format == format.format && frame.width == format.width && frame.height == format.height,
      "a frame has the format and size that the camera reports");
  expect(frame.bytes.size() == frame_bytes(frame.format, frame.width, frame.height) &&
             frame.bytes.size() <= convert::most_picture_bytes,
         "a frame is as long as its format and size say");
  expect(frame.sequence > last.sequence, "sequence numbers increase");
  expect(frame.timestamp_ns > last.timestamp_ns, "times increase");
  last = {frame.sequence, frame.timestamp_ns};
}

// Lets time pass and things happen, as the bytes say.
void happen(v4l2::FakeDevice& device, Camera& camera, Choices& choices) {
  const std::uint8_t what = choices.byte();
  switch (what % 8) {
    case 0:
      camera.stop();
      camera.start();
      break;
    case 1:
      camera.set_exposure(choices.byte() * 1e-3, 1);
      break;
    case 2:
      device.events.emplace_back().type = choices.byte() % 8u;
      break;
    case 3:
      device.dequeue_errors.push_back(errors[choices.byte() % std::size(errors)]);
      break;
    case 4:
      device.now_ns += choices.byte() * std::int64_t{1'000'000'000};
      break;
    default:
      device.send(device.now_ns, what);
  }
}

void v4l2_answers(Bytes bytes) {
  Choices choices(bytes);
  v4l2::FakeDevice device;
  set_up(device, choices);
  const CameraSettings settings = settings_of(choices);
  const auto camera =
      open_v4l2(std::make_unique<LyingNode>(device, choices), settings, device.clock);
  const CameraFormat format = camera->format();
  expect(frame_bytes(format.format, format.width, format.height) <= convert::most_picture_bytes,
         "no picture is larger than memory is asked for");
  camera->start();
  Last last;
  for (int times = 0; times < 24; ++times) {
    device.send(device.now_ns, 1);
    const CameraEvent event = camera->next(std::chrono::milliseconds(1));
    if (const auto* frame = std::get_if<FramePtr>(&event)) check_frame(**frame, format, last);
    happen(device, *camera, choices);
  }
}

constexpr Target own[] = {
    {"v4l2", "what a V4L2 driver answers", v4l2_answers},
};

}  // namespace v4l2_targets_cpp

std::span<const Target> v4l2_targets() {
  return v4l2_targets_cpp::own;
}

}  // namespace previz::fuzz
