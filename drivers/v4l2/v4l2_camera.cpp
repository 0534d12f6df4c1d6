#include "drivers/v4l2/v4l2_camera.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/frame_order.hpp"
#include "drivers/host_clock.hpp"
#include "drivers/patience.hpp"
#include "drivers/v4l2/configure.hpp"
#include "drivers/v4l2/find.hpp"

namespace previz {
namespace {

constexpr std::uint32_t buffers_wanted = 8;
// UVC cameras take an exposure over within a few frames of the control's transfer.
constexpr int v4l2_settle_frames = 4;
// A device that answers every call with an I/O error is gone, whatever it calls itself.
constexpr int errors_until_lost = 10;
constexpr int most_events = 16;

// A driver may write any 64 bits into both fields. What no clock shows becomes the nearest time
// that fits into nanoseconds, and FrameOrder then puts the arrival in its place.
std::int64_t to_ns(const timeval& time) {
  const std::int64_t seconds = std::clamp<std::int64_t>(time.tv_sec, 0, 9'000'000'000);
  const std::int64_t microseconds = std::clamp<std::int64_t>(time.tv_usec, 0, 999'999);
  return seconds * 1'000'000'000 + microseconds * 1000;
}

v4l2_buffer empty_buffer(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.index = index;
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

class V4l2Camera final : public Camera {
 public:
  V4l2Camera(std::unique_ptr<v4l2::Node> node, const CameraSettings& settings, HostClock clock)
      : settings_(settings),
        clock_(std::move(clock)),
        node_(std::move(node)),
        agreed_(v4l2::configure(*node_, settings)),
        ledger_(agreed_.exposure, v4l2_settle_frames),
        order_(counters_) {}
  ~V4l2Camera() override { stop(); }
  V4l2Camera(const V4l2Camera&) = delete;
  V4l2Camera& operator=(const V4l2Camera&) = delete;

  std::string name() const override { return settings_.device; }
  CameraFormat format() const override { return agreed_.format; }
  std::vector<std::string> doubts() const override { return agreed_.doubts; }
  DeviceCounters counters() const override { return counters_; }

  void start() override {
    if (streaming_) return;
    try {
      map_buffers();
      for (std::uint32_t i = 0; i < memory_.size(); ++i) {
        v4l2_buffer buffer = empty_buffer(i);
        check(node_->control(VIDIOC_QBUF, &buffer), "a buffer cannot be queued");
      }
      int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
      check(node_->control(VIDIOC_STREAMON, &type), "cannot start");
    } catch (const Error&) {
      release_buffers();
      throw;
    }
    v4l2_event_subscription changes{};
    changes.type = V4L2_EVENT_SOURCE_CHANGE;
    has_events_ = node_->control(VIDIOC_SUBSCRIBE_EVENT, &changes) == 0;
    streaming_ = true;
    errors_ = 0;
    order_.restart();
  }

  // The kernel takes all buffers back, so that none of them can come again.
  void stop() override {
    if (!streaming_) return;
    streaming_ = false;
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    node_->control(VIDIOC_STREAMOFF, &type);  // may fail: the device may be gone
    release_buffers();
  }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    if (!lost_.empty()) return DeviceTrouble{name(), lost_, true};
    if (!streaming_) return NoFrame{};
    return wait_patiently(clock_, timeout, [this](std::chrono::nanoseconds left) {
      return attempt(std::chrono::ceil<std::chrono::milliseconds>(left));
    });
  }

  bool set_exposure(double exposure_s, double gain) override {
    if (!agreed_.drives_exposure || gain != 1) return false;
    const std::int64_t before_ns = now_ns();
    const std::optional<double> applied = v4l2::set_exposure(*node_, exposure_s);
    if (!applied) {
      ++counters_["exposures refused"];
      return false;
    }
    ledger_.changed(before_ns, now_ns(), {*applied, 1});
    return true;
  }

 private:
  void check(int error, const char* what) const {
    if (error != 0) throw Error(name() + ": " + what + ": " + std::strerror(error));
  }

  std::int64_t now_ns() const {
    return std::chrono::nanoseconds(clock_.now().time_since_epoch()).count();
  }

  // Waits for a buffer; returns nothing for one without a whole frame.
  std::optional<CameraEvent> attempt(std::chrono::milliseconds left) {
    if (!node_->wait(left)) return NoFrame{};
    look_for_events();
    FramePtr frame = lost_.empty() ? dequeue() : nullptr;
    if (frame) return frame;
    if (!lost_.empty()) return DeviceTrouble{name(), lost_, true};
    return std::nullopt;
  }

  FramePtr dequeue() {
    v4l2_buffer buffer = empty_buffer(0);
    const int error = node_->control(VIDIOC_DQBUF, &buffer);
    if (error == EAGAIN) return nullptr;
    if (error != 0) {
      ++counters_["read errors"];
      if (error != EIO || ++errors_ >= errors_until_lost) lost_ = lost_text(error);
      return nullptr;
    }
    errors_ = 0;
    return take(buffer);
  }

  // A source that changes its picture (another size on the cable of a grabber) stops the stream,
  // and what still comes of it is of no use. The camera must be opened anew, with the new format.
  void look_for_events() {
    if (!has_events_) return;
    v4l2_event event{};
    // The kernel keeps a few events only.
    for (int i = 0; i < most_events && node_->control(VIDIOC_DQEVENT, &event) == 0; ++i) {
      const bool size_changed = event.type == V4L2_EVENT_SOURCE_CHANGE &&
                                (event.u.src_change.changes & V4L2_EVENT_SRC_CH_RESOLUTION) != 0;
      if (size_changed) lost_ = "has changed its picture size";
    }
  }

  static std::string lost_text(int error) {
    if (error == ENODEV) return "was unplugged";
    return std::string("cannot be read: ") + std::strerror(error);
  }

  void map_buffers() {
    v4l2_requestbuffers request{};
    request.count = buffers_wanted;
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    check(node_->control(VIDIOC_REQBUFS, &request), "returns no buffers");
    if (request.count < 2) throw Error(name() + ": returns fewer than two buffers");
    if (request.count > VIDEO_MAX_FRAME)
      throw Error(name() + ": reports " + std::to_string(request.count) +
                  " buffers, which is impossible");
    for (std::uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer = empty_buffer(i);
      check(node_->control(VIDIOC_QUERYBUF, &buffer), "does not describe its buffers");
      if (buffer.length < agreed_.least_bytes)
        throw Error(name() + ": returns buffers of " + std::to_string(buffer.length) +
                    " bytes; a picture needs " + std::to_string(agreed_.least_bytes));
      const std::span<const std::uint8_t> memory = node_->map(buffer.m.offset, buffer.length);
      if (memory.empty())
        throw Error(name() + ": a buffer cannot be mapped: " + std::strerror(errno));
      memory_.push_back(memory);
    }
  }

  void release_buffers() {
    for (const std::span<const std::uint8_t> memory : memory_) node_->unmap(memory);
    memory_.clear();
    v4l2_requestbuffers request{};
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    node_->control(VIDIOC_REQBUFS, &request);
  }

  // Returns the frame in a buffer and gives the buffer back to the kernel; null, and counted, if it
  // is not whole.
  FramePtr take(v4l2_buffer& buffer) {
    const std::int64_t arrival_ns = now_ns();
    if (buffer.index >= memory_.size()) return left_out("unknown buffers");
    FramePtr frame = read(buffer, arrival_ns);
    v4l2_buffer again = empty_buffer(buffer.index);
    const int error = node_->control(VIDIOC_QBUF, &again);
    if (error != 0) lost_ = lost_text(error);
    return frame;
  }

  FramePtr read(const v4l2_buffer& buffer, std::int64_t arrival_ns) {
    const std::uint64_t sequence = order_.sequence_of(buffer.sequence);
    if (buffer.flags & V4L2_BUF_FLAG_ERROR) return left_out("frames the device reports as damaged");
    const std::span<const std::uint8_t> memory = memory_[buffer.index];
    if (buffer.bytesused > memory.size()) return left_out("frames longer than their buffer");
    auto frame = std::make_shared<Frame>();
    if (convert::convert({agreed_.wire, agreed_.format.width, agreed_.format.height, agreed_.stride,
                          memory.first(buffer.bytesused)},
                         *frame))
      return left_out("frames cut short");
    frame->source = settings_.source;
    frame->sequence = sequence;
    frame->arrival_ns = arrival_ns;
    frame->timestamp_ns = order_.time_of(stamp_of(buffer), arrival_ns);
    const std::optional<Exposure> exposure = ledger_.of_frame(frame->timestamp_ns);
    if (!exposure) return left_out("frames during an exposure change");
    apply_exposure(*frame, *exposure, settings_.responsivity);
    return frame;
  }

  FramePtr left_out(const char* why) {
    ++counters_[why];
    return nullptr;
  }

  static std::optional<std::int64_t> stamp_of(const v4l2_buffer& buffer) {
    if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
      return std::nullopt;
    return to_ns(buffer.timestamp);
  }

  const CameraSettings settings_;
  const HostClock clock_;
  std::unique_ptr<v4l2::Node> node_;
  const v4l2::Agreed agreed_;
  ExposureLedger ledger_;
  std::vector<std::span<const std::uint8_t>> memory_;  // by buffer index; while streaming
  bool streaming_ = false;
  bool has_events_ = false;  // the node reports a change of its source
  std::string lost_;         // why nothing more comes; empty while all is well
  int errors_ = 0;           // in a row
  DeviceCounters counters_;
  FrameOrder order_;
};

}  // namespace

std::unique_ptr<Camera> open_v4l2(std::unique_ptr<v4l2::Node> node, const CameraSettings& settings,
                                  HostClock clock) {
  return std::make_unique<V4l2Camera>(std::move(node), settings, std::move(clock));
}

std::unique_ptr<Camera> open_v4l2(const CameraSettings& settings) {
  return open_v4l2(v4l2::open_node(v4l2::resolve(settings.device, v4l2::find_nodes())), settings);
}

std::vector<FoundCamera> find_v4l2() {
  std::vector<FoundCamera> cameras;
  const std::vector<v4l2::FoundNode> found = v4l2::find_nodes();
  for (const v4l2::FoundNode& node : found)
    cameras.push_back(
        {"v4l2", v4l2::stable_name(node, found), node.product + " at " + node.by_path});
  return cameras;
}

std::optional<usb::Place> usb_place_of_v4l2(const std::string& device) {
  const std::vector<v4l2::FoundNode> found = v4l2::find_nodes();
  try {
    const std::string file = v4l2::resolve(device, found);
    return std::ranges::find(found, file, &v4l2::FoundNode::node)->usb;
  } catch (const Error&) {
    return std::nullopt;  // not there
  }
}

}  // namespace previz
