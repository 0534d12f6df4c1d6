// A stand-in for a kernel's video node as the driver sees it; a test sets what it is and sends.
#pragma once

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "drivers/host_clock.hpp"
#include "drivers/v4l2/node.hpp"

namespace previz::v4l2 {

// Outlives the node that stands on it, so that a test can look at it afterwards. Time is the test's
// own, unless a test gives it the host's: it passes by waiting, and a little by each call.
struct FakeDevice {
  // What it can.
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::vector<std::uint32_t> formats{V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV};
  std::vector<std::pair<std::uint32_t, std::uint32_t>> sizes{{32, 24}, {16, 12}};
  std::map<std::uint32_t, std::vector<std::uint32_t>> rates;  // frames a second by format, if said
  std::uint32_t extra_stride = 0;
  std::uint32_t field = V4L2_FIELD_NONE;
  std::map<std::uint32_t, v4l2_queryctrl> controls;

  // What it is set to.
  v4l2_pix_format picture{};
  v4l2_fract period{1, 30};
  std::map<std::uint32_t, std::int32_t> values;

  // What it makes of what it is asked.
  std::optional<std::uint32_t> buffers_granted;  // none: as many as are asked for
  std::uint32_t most_mapped = 1000;              // buffers that can be mapped
  std::optional<std::uint32_t> buffer_length;    // none: sizeimage
  std::function<void(v4l2_pix_format&)> format_made = [](v4l2_pix_format&) {};
  std::optional<int> queues_until_error;  // so many buffers are queued; then ENOMEM
  bool has_events = false;
  bool has_rates_between = false;  // the first of `rates` is the greatest, the second the least

  // Its buffers, and what it has sent.
  std::vector<std::vector<std::uint8_t>> memory;
  int mapped = 0;
  bool streaming = false;
  std::vector<bool> queued;
  std::deque<v4l2_buffer> done;
  std::uint32_t sequence = 0;
  std::deque<int> dequeue_errors;  // given first
  std::deque<v4l2_event> events;
  bool subscribed = false;
  bool unplugged = false;
  bool damages_all = false;  // every buffer that is queued comes back at once, damaged

  // What it sends by itself, a frame each `frame_interval` from its start on.
  int frames_to_come = 0;
  std::function<void(FakeDevice&)> send_frame;  // the frame that is due at next_frame
  std::chrono::nanoseconds frame_interval = std::chrono::milliseconds(5);
  HostClock::Time next_frame{};
  std::chrono::nanoseconds dequeue_time{0};  // what the caller needs for a damaged buffer

  // Its time.
  std::int64_t now_ns = 1'000'000'000'000;
  HostClock clock{[this] { return HostClock::Time(std::chrono::nanoseconds(now_ns)); },
                  [this](HostClock::Time time) {
                    now_ns = std::max<std::int64_t>(
                        now_ns, std::chrono::nanoseconds(time.time_since_epoch()).count());
                  }};

  // What was asked of it.
  int dequeued = 0;
  std::chrono::milliseconds waited_in_vain{0};  // in all

  FakeDevice(const FakeDevice&) = delete;
  FakeDevice& operator=(const FakeDevice&) = delete;
  FakeDevice() {
    picture.pixelformat = V4L2_PIX_FMT_YUYV;
    picture.width = 32;
    picture.height = 24;
  }

  void add_control(std::uint32_t id, std::int32_t minimum, std::int32_t maximum,
                   std::int32_t value) {
    v4l2_queryctrl control{};
    control.id = id;
    control.minimum = minimum;
    control.maximum = maximum;
    controls[id] = control;
    values[id] = value;
  }

  // Fills the next queued buffer as a camera would; changed as `damage` says before it is sent.
  template <typename Damage>
  void send(std::int64_t timestamp_ns, std::uint8_t value, Damage damage) {
    const auto free = std::ranges::find(queued, true);
    v4l2_buffer buffer{};
    buffer.sequence = sequence++;
    if (free == queued.end()) return;  // dropped: nowhere to put it
    *free = false;
    buffer.index = static_cast<std::uint32_t>(free - queued.begin());
    std::ranges::fill(memory[buffer.index], value);
    buffer.bytesused = picture.sizeimage;
    buffer.flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    buffer.timestamp = {static_cast<time_t>(timestamp_ns / 1'000'000'000),
                        static_cast<suseconds_t>(timestamp_ns / 1000 % 1'000'000)};
    damage(buffer);
    done.push_back(buffer);
  }
  void send(std::int64_t timestamp_ns, std::uint8_t value) {
    send(timestamp_ns, value, [](v4l2_buffer&) {});
  }
};

class FakeNode final : public Node {
 public:
  explicit FakeNode(FakeDevice& device) : device_(device) {}

  bool wait(std::chrono::milliseconds timeout) override {
    const HostClock::Time end = device_.clock.now() + timeout;
    send_due();
    if (has_something()) return true;
    if (device_.frames_to_come > 0 && device_.next_frame <= end) {
      device_.clock.sleep_until(device_.next_frame);
      send_due();
      return true;
    }
    device_.waited_in_vain += timeout;
    device_.clock.sleep_until(end);
    return false;
  }

  std::span<const std::uint8_t> map(std::size_t offset, std::size_t length) override {
    if (device_.mapped >= static_cast<int>(device_.most_mapped) || length == 0) {
      errno = length == 0 ? EINVAL : ENOMEM;
      return {};
    }
    ++device_.mapped;
    return device_.memory.at(offset);
  }
  void unmap(std::span<const std::uint8_t>) override { --device_.mapped; }

  int control(unsigned long request, void* argument) override {
    device_.now_ns += 10'000;  // what a call takes
    if (device_.unplugged) return ENODEV;
    switch (request) {
      case VIDIOC_QUERYCAP:
        static_cast<v4l2_capability*>(argument)->capabilities = device_.capabilities;
        return 0;
      case VIDIOC_ENUM_FMT:
        return entry(*static_cast<v4l2_fmtdesc*>(argument));
      case VIDIOC_ENUM_FRAMESIZES:
        return entry(*static_cast<v4l2_frmsizeenum*>(argument));
      case VIDIOC_ENUM_FRAMEINTERVALS:
        return entry(*static_cast<v4l2_frmivalenum*>(argument));
      case VIDIOC_G_FMT:
        static_cast<v4l2_format*>(argument)->fmt.pix = device_.picture;
        return 0;
      case VIDIOC_S_FMT:
        return set(static_cast<v4l2_format*>(argument)->fmt.pix);
      case VIDIOC_S_PARM:
        return set(static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe);
      case VIDIOC_G_PARM:
        static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe = device_.period;
        return 0;
      case VIDIOC_QUERYCTRL:
        return query(*static_cast<v4l2_queryctrl*>(argument));
      case VIDIOC_S_CTRL:
        return write(*static_cast<v4l2_control*>(argument));
      case VIDIOC_G_CTRL:
        return read(*static_cast<v4l2_control*>(argument));
      default:
        return stream(request, argument);
    }
  }

 private:
  bool has_something() const {
    return device_.unplugged || device_.damages_all || !device_.done.empty() ||
           !device_.dequeue_errors.empty() || (device_.subscribed && !device_.events.empty());
  }

  // Sends every frame that is due by now, as a camera does while nobody waits for it.
  void send_due() {
    const HostClock::Time now = device_.clock.now();
    while (device_.streaming && device_.frames_to_come > 0 && device_.next_frame <= now) {
      --device_.frames_to_come;
      device_.send_frame(device_);
      device_.next_frame += device_.frame_interval;
    }
  }

  int entry(v4l2_fmtdesc& description) const {
    if (description.index >= device_.formats.size()) return EINVAL;
    description.pixelformat = device_.formats[description.index];
    return 0;
  }
  int entry(v4l2_frmsizeenum& size) const {
    if (size.index >= device_.sizes.size()) return EINVAL;
    size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    size.discrete = {device_.sizes[size.index].first, device_.sizes[size.index].second};
    return 0;
  }

  int entry(v4l2_frmivalenum& interval) const {
    const auto found = device_.rates.find(interval.pixel_format);
    if (found == device_.rates.end() || interval.index >= found->second.size()) return EINVAL;
    if (device_.has_rates_between) {
      interval.type = V4L2_FRMIVAL_TYPE_CONTINUOUS;
      interval.stepwise = {{1, found->second[0]}, {1, found->second[1]}, {1, 1}};
      return 0;
    }
    interval.type = V4L2_FRMIVAL_TYPE_DISCRETE;
    interval.discrete = {1, found->second[interval.index]};
    return 0;
  }

  // As drivers do: what is not possible becomes something that is.
  int set(v4l2_pix_format& wanted) {
    if (std::ranges::find(device_.formats, wanted.pixelformat) == device_.formats.end())
      wanted.pixelformat = device_.formats.front();
    if (std::ranges::find(device_.sizes, std::pair{wanted.width, wanted.height}) ==
        device_.sizes.end())
      std::tie(wanted.width, wanted.height) = device_.sizes.front();
    wanted.bytesperline = 2 * wanted.width + device_.extra_stride;
    wanted.sizeimage = wanted.bytesperline * wanted.height;
    wanted.field = device_.field;
    device_.format_made(wanted);
    device_.picture = wanted;
    return 0;
  }
  int set(v4l2_fract& wanted) {
    const auto found = device_.rates.find(device_.picture.pixelformat);
    const std::uint32_t most = found == device_.rates.end() ? 60 : found->second.front();
    if (wanted.denominator > most * wanted.numerator) wanted = {1, most};
    device_.period = wanted;
    return 0;
  }

  int query(v4l2_queryctrl& control) const {
    const auto found = device_.controls.find(control.id);
    if (found == device_.controls.end()) return EINVAL;
    control = found->second;
    return 0;
  }
  int write(const v4l2_control& control) {
    const auto found = device_.controls.find(control.id);
    if (found == device_.controls.end()) return EINVAL;
    if (control.value < found->second.minimum || control.value > found->second.maximum)
      return ERANGE;
    device_.values[control.id] = control.value;
    return 0;
  }
  int read(v4l2_control& control) const {
    const auto found = device_.values.find(control.id);
    if (found == device_.values.end()) return EINVAL;
    control.value = found->second;
    return 0;
  }

  int stream(unsigned long request, void* argument) {
    switch (request) {
      case VIDIOC_REQBUFS:
        return give(*static_cast<v4l2_requestbuffers*>(argument));
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.m.offset = buffer.index;
        buffer.length = device_.buffer_length.value_or(device_.picture.sizeimage);
        return 0;
      }
      case VIDIOC_QBUF:
        return queue(static_cast<v4l2_buffer*>(argument)->index);
      case VIDIOC_STREAMON:
        device_.streaming = true;
        device_.sequence = 0;
        device_.next_frame = device_.clock.now() + device_.frame_interval;
        return 0;
      case VIDIOC_SUBSCRIBE_EVENT:
        device_.subscribed = device_.has_events;
        return device_.has_events ? 0 : EINVAL;
      case VIDIOC_DQEVENT:
        if (!device_.subscribed || device_.events.empty()) return ENOENT;
        *static_cast<v4l2_event*>(argument) = device_.events.front();
        device_.events.pop_front();
        return 0;
      case VIDIOC_STREAMOFF:
        device_.streaming = false;
        device_.done.clear();
        device_.queued.assign(device_.queued.size(), false);
        return 0;
      case VIDIOC_DQBUF:
        return dequeue(*static_cast<v4l2_buffer*>(argument));
      default:
        return ENOTTY;
    }
  }

  // Of a claim that is more than can be, only what a test can have in memory is there.
  int give(v4l2_requestbuffers& request) {
    if (device_.mapped != 0) return EBUSY;
    if (request.count > 0) request.count = device_.buffers_granted.value_or(request.count);
    const std::size_t there = std::min<std::uint32_t>(request.count, 64);
    device_.memory.assign(there, std::vector<std::uint8_t>(device_.picture.sizeimage));
    device_.queued.assign(there, false);
    return 0;
  }

  int queue(std::uint32_t index) {
    if (index >= device_.queued.size() || device_.queued[index]) return EINVAL;
    if (device_.queues_until_error && (*device_.queues_until_error)-- <= 0) return ENOMEM;
    device_.queued[index] = true;
    return 0;
  }

  int dequeue(v4l2_buffer& buffer) {
    ++device_.dequeued;
    if (!device_.dequeue_errors.empty()) {
      const int error = device_.dequeue_errors.front();
      device_.dequeue_errors.pop_front();
      return error;
    }
    if (device_.damages_all) {
      device_.clock.sleep_until(device_.clock.now() + device_.dequeue_time);
      device_.send(0, 1, [](v4l2_buffer& damaged) { damaged.flags |= V4L2_BUF_FLAG_ERROR; });
    }
    if (device_.done.empty()) return EAGAIN;
    buffer = device_.done.front();
    device_.done.pop_front();
    return 0;
  }

  FakeDevice& device_;
};

}  // namespace previz::v4l2
