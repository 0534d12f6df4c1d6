// Keeps a camera alive: opens it when it appears, and opens it again when it is lost.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/backoff.hpp"
#include "drivers/camera.hpp"
#include "drivers/faults.hpp"
#include "drivers/host_clock.hpp"

namespace previz {

struct LifelineOptions {
  std::chrono::milliseconds start_timeout{5000};   // from start() to the first frame
  std::chrono::milliseconds stall_timeout{2000};   // between frames, until stalled
  std::chrono::milliseconds stall_patience{1000};  // while stalled, until lost
  BackoffLimits backoff;                           // between attempts to open
};

// Functions by which a lifeline asks the bus of its device; either may be empty.
struct LifelineHooks {
  // Returns how many devices have been plugged in so far. When the number grows, the next attempt
  // to open is due at once.
  std::function<std::uint64_t()> arrivals;
  // Resets a device that is silent while it should stream, before it is opened again. Returns "" if
  // it was reset, the reason if it could not be, and none if there is nothing to reset.
  std::function<std::optional<std::string>()> reset;
};

// A camera whose device may come and go. next() does whatever is due: it opens, starts, waits for a
// frame, closes. It belongs to one thread, so that a device that hangs holds up nobody else. Every
// opening settles the format anew; format() may change then, and no frame of the old format
// follows. Sequence numbers keep increasing over all openings.
//
// A camera that cannot be opened or stalls is reported once, and again only when the cause changes;
// the event `lost` then carries the cause, without a second report. An EndOfStream of the device
// ends this stream. A device whose driver throws is lost.
class Lifeline final : public Camera {
 public:
  // `name` stands in reports of trouble. Opens nothing yet.
  Lifeline(std::string name, CameraOpener open, const LifelineOptions& options = {},
           HostClock clock = {}, LifelineHooks hooks = {});

  std::string name() const override { return name_; }
  CameraFormat format() const override;  // that of the last opening; all zero before the first
  void start() override;                 // always succeeds; the device follows when it can
  void stop() override;                  // closes the device
  CameraEvent next(std::chrono::milliseconds timeout) override;
  // Asks for an exposure that later openings get, too. Returns true if the device takes it, or if
  // there is no device yet.
  bool set_exposure(double exposure_s, double gain) override;
  // Returns the sums over all openings, and "opened", "not opened", "stalled", "lost", "returned"
  // (opened after a loss), "back-offs" (waits before an attempt to open) and "reset".
  DeviceCounters counters() const override;

  DeviceState state() const { return state_; }

 private:
  std::optional<CameraEvent> open();
  CameraEvent ask(std::chrono::milliseconds timeout);
  std::optional<CameraEvent> take(CameraEvent event);
  FramePtr numbered(FramePtr frame);
  std::optional<CameraEvent> watch();
  std::optional<CameraEvent> not_opened(const std::string& why);
  CameraEvent lose(const std::string& why);
  CameraEvent lose_silent(const std::string& why);
  void look_for_arrivals();
  void close();
  HostClock::Time next_deadline() const;

  const std::string name_;
  const CameraOpener open_;
  const LifelineOptions options_;
  const HostClock clock_;
  const LifelineHooks hooks_;

  std::uint64_t arrivals_ = 0;  // last count seen
  DeviceState state_ = DeviceState::absent;
  bool wanted_ = false;             // started
  HostClock::Time since_{};         // start of the state, or time of the last frame
  Backoff backoff_;                 // absent and lost only
  std::string last_refusal_;        // reason last reported why the device could not be opened
  std::unique_ptr<Camera> camera_;  // starting, streaming and stalled only
  CameraFormat format_;
  std::uint64_t next_sequence_ = 0;               // the least number that increases
  std::optional<std::uint64_t> sequence_offset_;  // of this opening; none before its first frame
  struct Wanted {
    double exposure_s, gain;
  };
  std::optional<Wanted> exposure_;
  DeviceCounters counters_;  // those of closed openings, and the lifeline's own
};

}  // namespace previz
