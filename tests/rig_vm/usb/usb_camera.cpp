// A USB camera (UVC 1.0, YUYV over a bulk endpoint) with manual exposure, plugged into a guest of
// QEMU: it sends the light camera's frames of a recorded take at half their size, of those with the
// exposure that is nearest to the one it was given.
//   rig_vm_usb_camera SOCKET CABLE SESSION FRAMES_PER_SECOND
// It is plugged in as long as the file CABLE is there, and wedged, until it is reset or replugged,
// once CABLE.wedged comes into being.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>

#include "daemon/core/session/session.hpp"
#include "drivers/error.hpp"
#include "tests/rig_vm/usb/redirection.hpp"

namespace previz::test {
namespace {

using Clock = std::chrono::steady_clock;

// Of the USB video class 1.0: what a descriptor or a request is.
constexpr std::uint8_t video = 0x0e, of_control = 1, of_streaming = 2;
constexpr std::uint8_t device_kind = 1, configuration_kind = 2, interface_kind = 4,
                       endpoint_kind = 5, association_kind = 11, video_kind = 0x24;
constexpr std::uint8_t set_current = 0x01, get_current = 0x81, get_least = 0x82, get_most = 0x83,
                       get_step = 0x84, get_length = 0x85, get_abilities = 0x86, get_default = 0x87;
constexpr std::uint8_t camera_terminal = 1, usb_terminal = 2;
constexpr std::uint8_t auto_exposure_selector = 2, exposure_selector = 4;
constexpr std::uint8_t probe_selector = 1, commit_selector = 2;
constexpr std::uint8_t manual_exposure = 1;
constexpr double exposure_unit_s = 1e-4, interval_unit_s = 1e-7;
constexpr std::size_t payload_bytes = 16384, payload_header_bytes = 2;
constexpr std::size_t probe_bytes = 26;
constexpr std::uint8_t stream_endpoint = 0x81;

std::uint8_t clamped(double value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
}

// The recorded frames, by their exposure, as YUYV (BT.601, 16 to 235).
struct Take {
  int width = 0, height = 0;
  std::map<double, std::vector<Bytes>> frames;  // by exposure, seconds

  const std::vector<Bytes>& nearest(double exposure_s) const {
    const auto off = [&](const auto& group) {
      return std::abs(std::log(group.first / exposure_s));
    };
    return std::ranges::min_element(frames, {}, off)->second;
  }
};

// Every pixel the mean of four; two neighbours share their colour.
Bytes halved_yuyv(const Frame& frame) {
  const int width = frame.width / 2, height = frame.height / 2, row = 3 * frame.width;
  Bytes yuyv(static_cast<std::size_t>(2) * width * height);
  const auto mean = [&](int x, int y, int c) {
    const std::uint8_t* from = &frame.bytes[static_cast<std::size_t>(2 * y * row + 6 * x + c)];
    return (from[0] + from[3] + from[row] + from[row + 3]) / 4.0;
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double r = mean(x, y, 0), g = mean(x, y, 1), b = mean(x, y, 2);
      std::uint8_t* to = &yuyv[static_cast<std::size_t>(2 * (y * width + x))];
      to[0] = clamped(16 + 0.2568 * r + 0.5041 * g + 0.0979 * b);
      to[1] = x % 2 == 0 ? clamped(128 - 0.1482 * r - 0.2910 * g + 0.4392 * b)
                         : clamped(128 + 0.4392 * r - 0.3678 * g - 0.0714 * b);
    }
  return yuyv;
}

Take read_take(const char* directory) {
  session::Session session = session::open_session(directory);
  const auto stream = session::open_stream(session, "light");
  if (!stream || stream->format() != PixelFormat::rgb8)
    throw Error(std::string(directory) + ": no light camera in rgb8");
  Take take{stream->width() / 2, stream->height() / 2, {}};
  for (std::size_t i = 0; i < stream->records().size(); ++i) {
    const FramePtr frame = stream->read(i);
    take.frames[frame->exposure].push_back(halved_yuyv(*frame));
  }
  return take;
}

// A number that the host may set: a control of the class.
struct Adjustable {
  int bytes;
  std::uint32_t least, most, initial, value = initial;

  std::optional<Bytes> control(std::uint8_t request, std::span<const std::uint8_t> data) {
    switch (request) {
      case set_current:
        value = 0;
        for (std::size_t i = data.size(); i-- > 0;) value = value << 8 | data[i];
        return Bytes{};
      case get_current:
        return number(value, bytes);
      case get_least:
        return number(least, bytes);
      case get_most:
        return number(most, bytes);
      case get_step:
        return number(1, bytes);
      case get_length:
        return number(static_cast<std::uint64_t>(bytes), 2);
      case get_abilities:
        return Bytes{3};  // may be read and set
      case get_default:
        return number(initial, bytes);
      default:
        return std::nullopt;
    }
  }
};

class UsbCamera final : public UsbDevice {
 public:
  UsbCamera(Take take, double rate_hz, std::filesystem::path wedge)
      : take_(std::move(take)),
        interval_(static_cast<std::uint32_t>(std::lround(1 / (rate_hz * interval_unit_s)))),
        wedge_(std::move(wedge)) {}

  Bytes device_descriptor() const override {
    return descriptor(device_kind, {number(0x0200, 2),
                                    {0xef, 2, 1, 64},  // USB 2, by association
                                    number(0x1209, 2),
                                    number(2, 2),
                                    number(0x0100, 2),
                                    {1, 2, 3, 1}});
  }

  std::vector<std::string> strings() const override { return {"previz", "Rig camera", "RIGUSB1"}; }

  std::vector<Interface> interfaces() const override {
    return {{video, of_control, 0}, {video, of_streaming, 0}};
  }

  Input input() const override { return {stream_endpoint, Input::Kind::bulk, 1, 512, 0}; }

  // A camera terminal with exposure, straight to the USB; one format with one frame size.
  Bytes configuration_descriptor() const override {
    const Bytes units = joined(
        descriptor(
            video_kind,
            {{2, camera_terminal}, number(0x0201, 2), {0, 0}, number(0, 6), {3, 0x0a, 0, 0}}),
        descriptor(video_kind, {{3, usb_terminal}, number(0x0101, 2), {0, camera_terminal, 0}}));
    const Bytes control_header = descriptor(
        video_kind,
        {{1}, number(0x0100, 2), number(13 + units.size(), 2), number(48000000, 4), {1, 1}});
    const Bytes formats =
        joined(uncompressed_format(), frame_size(), Bytes{6, video_kind, 13, 1, 1, 4});
    const Bytes stream_header =
        descriptor(video_kind, {{1, 1},
                                number(14 + formats.size(), 2),
                                {stream_endpoint, 0, usb_terminal, 0, 0, 0, 1, 0}});
    const Bytes all = joined(
        descriptor(association_kind, {{0, 2, video, 3, 0, 0}}),
        descriptor(interface_kind, {{0, 0, 0, video, of_control, 0, 0}}), control_header, units,
        descriptor(interface_kind, {{1, 0, 1, video, of_streaming, 0, 0}}), stream_header, formats,
        descriptor(endpoint_kind, {{stream_endpoint, 2}, number(512, 2), {0}}));
    return joined(descriptor(configuration_kind, {number(9 + all.size(), 2), {2, 1, 0, 0x80, 250}}),
                  all);
  }

  std::optional<Bytes> control(const SetupPacket& setup,
                               std::span<const std::uint8_t> data) override {
    const int interface = setup.index & 255, entity = setup.index >> 8, selector = setup.value >> 8;
    if (interface == 1 && (selector == probe_selector || selector == commit_selector))
      return negotiate(setup.request, selector == commit_selector);
    if (entity != camera_terminal) return std::nullopt;
    if (selector == auto_exposure_selector)
      return setup.request == get_step ? Bytes{manual_exposure}  // the modes there are
                                       : exposure_mode_.control(setup.request, data);
    if (selector == exposure_selector) return exposure_.control(setup.request, data);
    return std::nullopt;
  }

  std::optional<Bytes> say(std::size_t room) override {
    if (!streaming_ || Clock::now() < due_ || exists(wedge_)) return std::nullopt;
    if (sent_bytes_ == 0) {
      const std::vector<Bytes>& frames = take_.nearest(exposure_.value * exposure_unit_s);
      frame_ = &frames[sent_frames_ % frames.size()];
    }
    const std::size_t size = std::min(std::min(room, payload_bytes) - payload_header_bytes,
                                      frame_->size() - sent_bytes_);
    const bool last = sent_bytes_ + size == frame_->size();
    // Frames are told apart by a bit that toggles; another says that one is whole.
    Bytes payload{payload_header_bytes,
                  static_cast<std::uint8_t>(0x80 | (sent_frames_ & 1) | (last ? 2 : 0))};
    const auto from = frame_->begin() + static_cast<std::ptrdiff_t>(sent_bytes_);
    payload.insert(payload.end(), from, from + static_cast<std::ptrdiff_t>(size));
    sent_bytes_ += size;
    if (last) {
      sent_bytes_ = 0;
      ++sent_frames_;
      const auto interval = std::chrono::nanoseconds(100) * interval_;
      due_ = std::max(due_ + interval, Clock::now());
    }
    return payload;
  }

  void reset() override {
    streaming_ = false;
    remove(wedge_);
  }

 private:
  static Bytes uncompressed_format() {
    static constexpr std::uint8_t yuy2[16] = {'Y',  'U', 'Y', '2',  0, 0,    0x10, 0,
                                              0x80, 0,   0,   0xaa, 0, 0x38, 0x9b, 0x71};
    return descriptor(video_kind, {{4, 1, 1}, Bytes(yuy2, yuy2 + 16), {16, 1, 0, 0, 0, 0}});
  }

  std::size_t frame_bytes() const {
    return static_cast<std::size_t>(2) * take_.width * take_.height;
  }

  Bytes frame_size() const {
    const auto bits_per_second = static_cast<std::uint64_t>(8 * static_cast<double>(frame_bytes()) /
                                                            (interval_ * interval_unit_s));
    return descriptor(video_kind, {{5, 1, 0},
                                   number(static_cast<std::uint64_t>(take_.width), 2),
                                   number(static_cast<std::uint64_t>(take_.height), 2),
                                   number(bits_per_second, 4),
                                   number(bits_per_second, 4),
                                   number(frame_bytes(), 4),
                                   number(interval_, 4),
                                   {1},
                                   number(interval_, 4)});
  }

  // There is one format, one size and one rate to agree on. A commit starts the stream.
  std::optional<Bytes> negotiate(std::uint8_t request, bool commit) {
    if (request == set_current) {
      if (commit) start();
      return Bytes{};
    }
    if (request == get_length) return number(probe_bytes, 2);
    if (request == get_abilities) return Bytes{3};
    return joined(number(1, 2), Bytes{1, 1}, number(interval_, 4), number(0, 10),
                  number(frame_bytes(), 4), number(payload_bytes, 4));
  }

  void start() {
    streaming_ = true;
    sent_bytes_ = 0;
    due_ = Clock::now();
  }

  const Take take_;
  const std::uint32_t interval_;  // between frames, in interval_unit_s
  const std::filesystem::path wedge_;
  Adjustable exposure_mode_{1, manual_exposure, manual_exposure, manual_exposure};
  Adjustable exposure_{4, 1, 10000, 31};  // in exposure_unit_s
  bool streaming_ = false;
  const Bytes* frame_ = nullptr;  // that is being sent
  std::size_t sent_bytes_ = 0;    // of it
  std::size_t sent_frames_ = 0;
  Clock::time_point due_;
};

}  // namespace
}  // namespace previz::test

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: rig_vm_usb_camera SOCKET CABLE SESSION FRAMES_PER_SECOND\n");
    return 2;
  }
  try {
    using namespace previz::test;
    UsbCamera camera(read_take(argv[3]), std::atof(argv[4]), std::string(argv[2]) + ".wedged");
    serve(camera, argv[1], argv[2]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rig_vm_usb_camera: %s\n", error.what());
    return 1;
  }
}
