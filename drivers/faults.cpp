#include "drivers/faults.hpp"

#include <atomic>
#include <charconv>
#include <deque>
#include <optional>
#include <string_view>
#include <utility>

#include "drivers/error.hpp"

namespace previz {

struct FaultyDevice::State {
  std::vector<Fault> plan;
  HostClock clock;
  std::atomic<bool> plugged = true;
  HostClock::Time back{};    // when a planned disconnection ends
  std::uint64_t frames = 0;  // frames that the device has delivered

  // Returns the fault that hits the frame'th frame.
  const Fault* fault_at(std::uint64_t frame) const {
    for (const Fault& fault : plan)
      if (frame >= fault.frame && frame - fault.frame < fault.frames) return &fault;
    return nullptr;
  }
};

namespace {

using Kind = Fault::Kind;

class FaultyCamera final : public Camera {
 public:
  FaultyCamera(std::unique_ptr<Camera> camera, std::shared_ptr<FaultyDevice::State> device)
      : camera_(std::move(camera)), device_(std::move(device)) {}

  std::string name() const override { return camera_->name(); }
  CameraFormat format() const override { return camera_->format(); }
  std::vector<std::string> doubts() const override { return camera_->doubts(); }
  DeviceCounters counters() const override { return camera_->counters(); }
  bool set_exposure(double exposure_s, double gain) override {
    return camera_->set_exposure(exposure_s, gain);
  }

  void start() override {
    if (!device_->plugged) throw Error(name() + ": is unplugged");
    camera_->start();
  }

  void stop() override {
    camera_->stop();
    held_.clear();
    ready_.clear();
    stalled_ = false;
  }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    if (!device_->plugged) lost_ = true;
    if (lost_) return DeviceTrouble{name(), "was unplugged", true};
    const HostClock::Time deadline = device_->clock.now() + timeout;
    do {
      if (!ready_.empty()) return take_ready();
      const auto left =
          std::chrono::ceil<std::chrono::milliseconds>(deadline - device_->clock.now());
      CameraEvent event = camera_->next(std::max(left, std::chrono::milliseconds(0)));
      const auto* frame = std::get_if<FramePtr>(&event);
      if (std::holds_alternative<EndOfStream>(event) && !held_.empty()) {
        ready_ = std::exchange(held_, {});
        return take_ready();
      }
      if (!frame) return event;
      if (std::optional<CameraEvent> affliction = afflict(*frame)) return *std::move(affliction);
    } while (device_->clock.now() < deadline || !ready_.empty());
    return NoFrame{};
  }

 private:
  CameraEvent take_ready() {
    FramePtr frame = std::move(ready_.front());
    ready_.pop_front();
    return frame;
  }

  // Returns what becomes of a frame; nothing if it is lost or held for later.
  std::optional<CameraEvent> afflict(const FramePtr& frame) {
    const std::uint64_t index = device_->frames++;
    if (!held_.empty() && index >= release_) return release(frame);
    if (!held_.empty()) return held_.push_back(frame), std::nullopt;
    const Fault* fault = device_->fault_at(index);
    if (fault && fault->kind == Kind::stall) stalled_ = true;
    if (stalled_) return std::nullopt;
    if (!fault) return frame;
    switch (fault->kind) {
      case Kind::corrupt:
        return DeviceTrouble{
            name(), "frame " + std::to_string(frame->sequence) + " is damaged and skipped"};
      case Kind::disconnect:
        device_->back = device_->clock.now() + fault->absent;
        lost_ = true;
        return DeviceTrouble{name(), "was unplugged", true};
      case Kind::late:
        release_ = fault->frame + fault->frames;
        held_.push_back(frame);
        return std::nullopt;
      case Kind::drop:
      case Kind::stall:
        break;
    }
    return std::nullopt;
  }

  // Releases all held frames; they arrive together with this one.
  std::optional<CameraEvent> release(const FramePtr& last) {
    for (const FramePtr& frame : held_) {
      auto late = std::make_shared<Frame>(*frame);
      late->arrival_ns = last->arrival_ns;
      ready_.push_back(std::move(late));
    }
    held_.clear();
    ready_.push_back(last);
    return take_ready();
  }

  std::unique_ptr<Camera> camera_;
  std::shared_ptr<FaultyDevice::State> device_;
  std::deque<FramePtr> held_, ready_;
  std::uint64_t release_ = 0;  // the frame that lets the held ones go
  bool stalled_ = false;
  bool lost_ = false;
};

[[noreturn]] void refuse(const std::string& text) {
  throw Error("fault \"" + text +
              "\": allowed are drop@FRAME+COUNT, corrupt@FRAME+COUNT, late@FRAME+COUNT (COUNT 1 if "
              "omitted), stall@FRAME and disconnect@FRAME+SECONDSs");
}

// Parses the whole of `text` as a number.
template <typename Number>
Number number(std::string_view text, const std::string& whole) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) refuse(whole);
  if constexpr (std::is_floating_point_v<Number>)
    if (!std::isfinite(value)) refuse(whole);
  return value;
}

}  // namespace

Fault parse_fault(const std::string& text) {
  constexpr std::pair<std::string_view, Kind> kinds[] = {{"drop", Kind::drop},
                                                         {"corrupt", Kind::corrupt},
                                                         {"late", Kind::late},
                                                         {"stall", Kind::stall},
                                                         {"disconnect", Kind::disconnect}};
  const std::size_t at = text.find('@');
  if (at == std::string::npos) refuse(text);
  const std::string_view kind_text = std::string_view(text).substr(0, at);
  std::string_view rest = std::string_view(text).substr(at + 1);
  std::optional<std::string_view> amount;
  if (const std::size_t plus = rest.find('+'); plus != std::string_view::npos) {
    amount = rest.substr(plus + 1);
    rest = rest.substr(0, plus);
  }
  for (const auto& [name, kind] : kinds) {
    if (name != kind_text) continue;
    Fault fault{kind, number<std::uint64_t>(rest, text)};
    if (kind == Kind::disconnect) {
      if (!amount || !amount->ends_with('s')) refuse(text);
      const auto seconds = number<double>(amount->substr(0, amount->size() - 1), text);
      if (!(seconds >= 0 && seconds <= 86'400)) refuse(text);
      fault.absent = std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
    } else if (amount) {
      fault.frames = number<std::uint64_t>(*amount, text);
      if (kind == Kind::stall || fault.frames == 0) refuse(text);
    }
    return fault;
  }
  refuse(text);
}

FaultyDevice::FaultyDevice(CameraOpener open, std::vector<Fault> plan, HostClock clock)
    : open_(std::move(open)), state_(std::make_shared<State>()) {
  state_->plan = std::move(plan);
  state_->clock = std::move(clock);
}

std::unique_ptr<Camera> FaultyDevice::open() {
  if (!state_->plugged || state_->clock.now() < state_->back)
    throw Error("the device is unplugged");
  return std::make_unique<FaultyCamera>(open_(), state_);
}

void FaultyDevice::unplug() {
  state_->plugged = false;
}

void FaultyDevice::plug() {
  state_->plugged = true;
}

CameraOpener with_faults(CameraOpener open, std::vector<Fault> plan, HostClock clock) {
  return [device = std::make_shared<FaultyDevice>(std::move(open), std::move(plan),
                                                  std::move(clock))] { return device->open(); };
}

}  // namespace previz
