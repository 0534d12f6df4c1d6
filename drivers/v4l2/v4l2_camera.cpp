#include "drivers/v4l2/v4l2_camera.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/frame_order.hpp"
#include "drivers/host_clock.hpp"
#include "drivers/v4l2/configure.hpp"
#include "drivers/v4l2/find.hpp"

namespace previz {
namespace {

constexpr std::uint32_t buffers_wanted = 8;
// UVC cameras take an exposure over within a few frames of the control's transfer.
constexpr int v4l2_settle_frames = 4;
// A device that answers every call with an I/O error is gone, whatever it calls itself.
constexpr int errors_until_lost = 10;

std::int64_t to_ns(const timeval& time) {
  return std::int64_t{time.tv_sec} * 1'000'000'000 + std::int64_t{time.tv_usec} * 1000;
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
  V4l2Camera(std::unique_ptr<v4l2::Node> node, const CameraSettings& settings)
      : settings_(settings),
        node_(std::move(node)),
        agreed_(v4l2::configure(*node_, settings)),
        ledger_(agreed_.exposure, v4l2_settle_frames),
        order_(counters_) {}
  ~V4l2Camera() override { stop(); }
  V4l2Camera(const V4l2Camera&) = delete;
  V4l2Camera& operator=(const V4l2Camera&) = delete;

  std::string name() const override { return settings_.device; }
  CameraFormat format() const override { return agreed_.format; }
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
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    std::size_t late = 0;  // buffers without a frame after the deadline; those that wait are taken
    for (;;) {
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
      if (!node_->wait(std::max(left, std::chrono::milliseconds(0)))) return NoFrame{};
      v4l2_buffer buffer = empty_buffer(0);
      const int error = node_->control(VIDIOC_DQBUF, &buffer);
      if (error == 0) {
        errors_ = 0;
        if (FramePtr frame = take(buffer)) return frame;
      } else if (error != EAGAIN) {
        ++counters_["read errors"];
        if (error != EIO || ++errors_ >= errors_until_lost) lost_ = lost_text(error);
      }
      if (!lost_.empty()) return DeviceTrouble{name(), lost_, true};
      if (std::chrono::steady_clock::now() >= deadline &&
          (error == EAGAIN || ++late >= memory_.size()))
        return NoFrame{};
    }
  }

  bool set_exposure(double exposure_s, double gain) override {
    if (!agreed_.drives_exposure || gain != 1) return false;
    const std::int64_t before_ns = monotonic_ns();
    const std::optional<double> applied = v4l2::set_exposure(*node_, exposure_s);
    if (!applied) {
      ++counters_["exposures refused"];
      return false;
    }
    ledger_.changed(before_ns, monotonic_ns(), {*applied, 1});
    return true;
  }

 private:
  void check(int error, const char* what) const {
    if (error != 0) throw Error(name() + ": " + what + ": " + std::strerror(error));
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
    check(node_->control(VIDIOC_REQBUFS, &request), "gives no buffers");
    if (request.count < 2) throw Error(name() + ": gives fewer than two buffers");
    for (std::uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer = empty_buffer(i);
      check(node_->control(VIDIOC_QUERYBUF, &buffer), "does not describe its buffers");
      memory_.push_back(node_->map(buffer.m.offset, buffer.length));
      if (memory_.back().empty()) check(errno, "a buffer cannot be mapped");
    }
  }

  void release_buffers() {
    for (const std::span<const std::uint8_t> memory : memory_)
      if (!memory.empty()) node_->unmap(memory);
    memory_.clear();
    v4l2_requestbuffers request{};
    request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    request.memory = V4L2_MEMORY_MMAP;
    node_->control(VIDIOC_REQBUFS, &request);
  }

  // Returns the frame in a buffer and gives the buffer back to the kernel; null, and counted, if it
  // is not whole.
  FramePtr take(v4l2_buffer& buffer) {
    const std::int64_t arrival_ns = monotonic_ns();
    if (buffer.index >= memory_.size()) return left_out("buffers that are none of ours");
    FramePtr frame = read(buffer, arrival_ns);
    v4l2_buffer again = empty_buffer(buffer.index);
    const int error = node_->control(VIDIOC_QBUF, &again);
    if (error != 0) lost_ = lost_text(error);
    return frame;
  }

  FramePtr read(const v4l2_buffer& buffer, std::int64_t arrival_ns) {
    const std::uint64_t sequence = order_.sequence_of(buffer.sequence);
    if (buffer.flags & V4L2_BUF_FLAG_ERROR) return left_out("frames the device says are damaged");
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
    if (!exposure) return left_out("frames between two exposures");
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
  std::unique_ptr<v4l2::Node> node_;
  const v4l2::Agreed agreed_;
  ExposureLedger ledger_;
  std::vector<std::span<const std::uint8_t>> memory_;  // by buffer index; while streaming
  bool streaming_ = false;
  std::string lost_;  // why nothing more comes; empty while all is well
  int errors_ = 0;    // in a row
  DeviceCounters counters_;
  FrameOrder order_;
};

}  // namespace

std::unique_ptr<Camera> open_v4l2(std::unique_ptr<v4l2::Node> node,
                                  const CameraSettings& settings) {
  return std::make_unique<V4l2Camera>(std::move(node), settings);
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
