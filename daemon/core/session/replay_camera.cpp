#include "daemon/core/session/replay_camera.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <span>
#include <utility>

#include "drivers/error.hpp"

namespace previz {
namespace {

using std::chrono::nanoseconds;

// Recorded times can be anything; see wrapping_sum().
std::int64_t product(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) * static_cast<std::uint64_t>(b));
}

class ReplayCamera final : public Camera {
 public:
  ReplayCamera(std::shared_ptr<session::StreamReader> stream, std::string name,
               const ReplayOptions& options, HostClock clock,
               const std::vector<std::string>& trouble)
      : stream_(std::move(stream)),
        name_(std::move(name)),
        options_(options),
        clock_(std::move(clock)),
        trouble_(trouble.begin(), trouble.end()) {
    if (!std::isfinite(options_.speed) || options_.speed < 0)
      throw Error(name_ + ": replay speed " + std::to_string(options_.speed) +
                  " is not allowed; 0 or more is");
    if (stream_->records().empty()) throw Error(name_ + ": has no complete frame to replay");
    options_.last = std::min(options_.last, stream_->records().size() - 1);
    if (options_.first > options_.last)
      throw Error(name_ + ": replay from frame " + std::to_string(options_.first) +
                  " is not possible; the last is " + std::to_string(options_.last));
    if (!options_.position)
      options_.position = std::make_shared<ReplayPosition>(ReplayPosition{options_.first, 0});
    at_ = options_.position;
    at_->index = std::clamp(at_->index, options_.first, options_.last + 1);
    format_ = {stream_->format(), stream_->width(), stream_->height(), rate_hz(), stream_->bayer()};
  }

  std::string name() const override { return name_; }
  bool set_exposure(double, double) override { return false; }
  CameraFormat format() const override { return format_; }
  DeviceCounters counters() const override { return {{"frames unreadable", unreadable_}}; }

  void start() override {
    if (streaming_) return;
    streaming_ = true;
    if (options_.origin && options_.speed > 0 && begun()) skip_missed();
  }

  void stop() override {
    streaming_ = false;
    pending_.reset();
  }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    if (!streaming_) return NoFrame{};
    if (!trouble_.empty()) {
      DeviceTrouble trouble{name_, trouble_.front()};
      trouble_.pop_front();
      return trouble;
    }
    const HostClock::Time asked = clock_.now();
    if (!pending_ && !load()) return EndOfStream{};
    if (options_.speed > 0) {
      if (!options_.origin) options_.origin = {asked, timestamp_ns(at_->index)};
      const HostClock::Time due = due_time();
      const HostClock::Time deadline = asked + timeout;
      if (due > clock_.now()) clock_.sleep_until(std::min(due, deadline));
      if (due > deadline) return NoFrame{};
    }
    ++at_->index;
    return *std::exchange(pending_, std::nullopt);
  }

 private:
  // Returns how much later this lap is than the recording.
  std::int64_t shift_ns() const { return product(at_->lap, lap_ns()); }

  std::int64_t timestamp_ns(std::size_t index) const {
    return wrapping_sum(stream_->records()[index].timestamp_ns, shift_ns());
  }

  HostClock::Time due_time() const {
    constexpr double one_year_ns = 366.0 * 86'400e9;
    const auto elapsed_ns = static_cast<double>(
        wrapping_difference(timestamp_ns(at_->index), options_.origin->timestamp_ns));
    const double wait_ns = std::clamp(elapsed_ns / options_.speed, -one_year_ns, one_year_ns);
    return options_.origin->due + nanoseconds(static_cast<std::int64_t>(wait_ns));
  }

  std::int64_t own_lap_ns() const {
    return replay_lap_ns(
        std::span(stream_->records()).subspan(options_.first, options_.last - options_.first + 1));
  }
  std::int64_t lap_ns() const { return options_.lap_ns > 0 ? options_.lap_ns : own_lap_ns(); }

  double rate_hz() const {
    const std::int64_t lap = own_lap_ns();
    const auto frames = static_cast<double>(options_.last - options_.first + 1);
    return lap > 0 && frames > 1 ? options_.speed * frames * 1e9 / static_cast<double>(lap) : 0;
  }

  std::uint64_t lap_sequence() const {
    const auto& records = stream_->records();
    return records[options_.last].sequence - records[options_.first].sequence + 1;
  }

  bool begun() const { return at_->index > options_.first || at_->lap > 0; }

  // Moves to the start of the next lap if this one is over; returns false at the end of the stream.
  bool wrap() {
    if (at_->index <= options_.last) return true;
    if (!options_.loop) return false;
    at_->index = options_.first;
    ++at_->lap;
    return true;
  }

  void skip_missed() {
    if (!wrap()) return;
    const auto late_ns = static_cast<double>((clock_.now() - due_time()).count()) * options_.speed;
    if (options_.loop && lap_ns() > 0 && late_ns > 0)
      at_->lap += static_cast<std::int64_t>(late_ns / static_cast<double>(lap_ns()));
    const std::size_t frames_of_a_lap = options_.last - options_.first + 1;
    for (std::size_t i = 0; i < frames_of_a_lap && wrap() && due_time() < clock_.now(); ++i)
      ++at_->index;
  }

  // Reads a frame before it is due, so that decoding does not make the frame late.
  bool load() {
    if (!wrap()) return false;
    try {
      pending_ = on_this_lap(stream_->read(at_->index));
    } catch (const Error& error) {
      ++unreadable_;
      pending_ = DeviceTrouble{name_, std::string(error.what()) + "; the frame is skipped"};
    }
    return true;
  }

  FramePtr on_this_lap(FramePtr recorded) const {
    if (at_->lap == 0) return recorded;
    auto frame = std::make_shared<Frame>(*recorded);
    frame->timestamp_ns = wrapping_sum(frame->timestamp_ns, shift_ns());
    frame->arrival_ns = wrapping_sum(frame->arrival_ns, shift_ns());
    frame->sequence += static_cast<std::uint64_t>(at_->lap) * lap_sequence();
    return frame;
  }

  std::shared_ptr<session::StreamReader> stream_;
  std::string name_;
  ReplayOptions options_;
  HostClock clock_;
  CameraFormat format_;
  std::deque<std::string> trouble_;
  bool streaming_ = false;
  std::uint64_t unreadable_ = 0;
  std::shared_ptr<ReplayPosition> at_;  // position of the pending frame, or of the next to load
  std::optional<CameraEvent> pending_;
};

}  // namespace

// A lap is the frames' span and one mean interval.
std::int64_t replay_lap_ns(std::span<const session::FrameRecord> records) {
  const std::int64_t span =
      wrapping_difference(records.back().timestamp_ns, records.front().timestamp_ns);
  const auto intervals = static_cast<std::int64_t>(records.size() - 1);
  return intervals > 0 ? wrapping_sum(span, span / intervals) : 1'000'000'000;
}

std::unique_ptr<Camera> replay(std::shared_ptr<session::StreamReader> stream, std::string name,
                               const ReplayOptions& options, const HostClock& clock,
                               const std::vector<std::string>& trouble) {
  return std::make_unique<ReplayCamera>(std::move(stream), std::move(name), options, clock,
                                        trouble);
}

std::unique_ptr<Camera> open_replay(const std::filesystem::path& session, const std::string& source,
                                    const ReplayOptions& options, const HostClock& clock) {
  session::Session opened = session::open_session(session);
  std::unique_ptr<session::StreamReader> stream = session::open_stream(opened, source);
  const std::string name = (session / source).string();
  if (!stream) throw Error(name + ": the session has no such stream");
  return replay(std::move(stream), name, options, clock, opened.missing);
}

}  // namespace previz
