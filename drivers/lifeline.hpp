// A camera that is never given up: opened when it appears, opened again when it is lost.
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
  std::chrono::milliseconds stall_timeout{2000};   // between frames; to stalled
  std::chrono::milliseconds stall_patience{1000};  // in stalled; to lost
  BackoffLimits backoff;                           // between attempts to open
};

// What a lifeline can ask of the bus its device is on; empty: nothing.
struct LifelineHooks {
  // How many devices have been plugged in so far. When it grows, the next attempt to open is due at
  // once.
  std::function<std::uint64_t()> arrivals;
  // Resets a device that is silent while it should stream, before it is opened anew. Empty, or why
  // it could not be done; none where there is nothing to reset.
  std::function<std::optional<std::string>()> reset;
};

// A camera whose device may come and go. next() does in turn what is due: opens, starts, waits for
// a frame, closes; it belongs to one thread, so that a device that hangs holds up nobody else. Each
// time the device is opened all is agreed anew; format() may be another then, and no frame of the
// old one follows. Sequence numbers keep increasing over all openings.
//
// Trouble is told once for each change to the worse, and never says `lost`. An EndOfStream of the
// device ends this stream.
class Lifeline final : public Camera {
 public:
  // `name` is what trouble is told under. Opens nothing yet.
  Lifeline(std::string name, CameraOpener open, const LifelineOptions& options = {},
           HostClock clock = {}, LifelineHooks hooks = {});

  std::string name() const override { return name_; }
  CameraFormat format() const override;  // of the last opening; before the first all zero
  void start() override;                 // always succeeds; the device follows when it can
  void stop() override;                  // closes the device
  CameraEvent next(std::chrono::milliseconds timeout) override;
  // Also for openings to come. True where the device, or no device yet, takes it.
  bool set_exposure(double exposure_s, double gain) override;
  // Of all openings together; and "opened", "not opened", "stalled", "lost", "returned" (opened
  // after a loss), "back-offs" (waits before an attempt to open), "reset".
  DeviceCounters counters() const override;

  DeviceState state() const { return state_; }

 private:
  std::optional<CameraEvent> open();
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

  std::uint64_t arrivals_ = 0;  // seen
  DeviceState state_ = DeviceState::absent;
  bool wanted_ = false;             // started
  HostClock::Time since_{};         // the state, or the last frame
  Backoff backoff_;                 // absent and lost only
  std::string last_refusal_;        // why the device could not be opened, as last told
  std::unique_ptr<Camera> camera_;  // starting, streaming and stalled only
  CameraFormat format_;
  std::uint64_t next_sequence_ = 0;               // the least that increases
  std::optional<std::uint64_t> sequence_offset_;  // of this opening; none before its first frame
  struct Wanted {
    double exposure_s, gain;
  };
  std::optional<Wanted> exposure_;
  DeviceCounters counters_;  // of closed openings, and our own
};

}  // namespace previz
