#include "drivers/replay/replay_camera.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <thread>
#include <utility>

#include "drivers/error.hpp"

namespace previz {
namespace {

using std::chrono::nanoseconds;

// Recorded times can be anything; arithmetic on them wraps rather than overflows.
std::int64_t sum(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}
std::int64_t difference(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}
std::int64_t product(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) * static_cast<std::uint64_t>(b));
}

class ReplayCamera final : public Camera {
 public:
  ReplayCamera(std::unique_ptr<session::StreamReader> stream, std::string name,
               const ReplayOptions& options, ReplayClock clock,
               const std::vector<std::string>& trouble)
      : stream_(std::move(stream)),
        name_(std::move(name)),
        options_(options),
        clock_(std::move(clock)),
        trouble_(trouble.begin(), trouble.end()) {
    if (!std::isfinite(options_.speed) || options_.speed < 0)
      throw Error(name_ + ": replay speed " + std::to_string(options_.speed) +
                  " is not allowed; 0 or more is");
    if (stream_->records().empty()) throw Error(name_ + ": holds no whole frame to replay");
    options_.last = std::min(options_.last, stream_->records().size() - 1);
    if (options_.first > options_.last)
      throw Error(name_ + ": replay from frame " + std::to_string(options_.first) +
                  " is not possible; the last is " + std::to_string(options_.last));
    if (!clock_.sleep_until)
      clock_.sleep_until = [](ReplayClock::Time time) { std::this_thread::sleep_until(time); };
    index_ = options_.first;
  }

  std::string name() const override { return name_; }
  bool set_exposure(double, double) override { return false; }

  CameraEvent next(std::chrono::milliseconds timeout) override {
    if (!trouble_.empty()) {
      DeviceTrouble trouble{name_, trouble_.front()};
      trouble_.pop_front();
      return trouble;
    }
    const ReplayClock::Time asked = clock_.now();
    if (!pending_ && !load()) return EndOfStream{};
    if (options_.speed > 0) {
      if (!options_.origin) options_.origin = {asked, timestamp_ns(index_)};
      const ReplayClock::Time due = due_time();
      const ReplayClock::Time deadline = asked + timeout;
      if (due > clock_.now()) clock_.sleep_until(std::min(due, deadline));
      if (due > deadline) return NoFrame{};
    }
    ++index_;
    return *std::exchange(pending_, std::nullopt);
  }

 private:
  // How much later this lap is than the recording.
  std::int64_t shift_ns() const { return product(lap_, lap_ns()); }

  std::int64_t timestamp_ns(std::size_t index) const {
    return sum(stream_->records()[index].timestamp_ns, shift_ns());
  }

  ReplayClock::Time due_time() const {
    constexpr double one_year_ns = 366.0 * 86'400e9;
    const auto elapsed_ns =
        static_cast<double>(difference(timestamp_ns(index_), options_.origin->timestamp_ns));
    const double wait_ns = std::clamp(elapsed_ns / options_.speed, -one_year_ns, one_year_ns);
    return options_.origin->due + nanoseconds(static_cast<std::int64_t>(wait_ns));
  }

  // From a frame to the same frame a lap later: the frames' span and one mean interval.
  std::int64_t lap_ns() const {
    const auto& records = stream_->records();
    const std::int64_t span =
        difference(records[options_.last].timestamp_ns, records[options_.first].timestamp_ns);
    const auto intervals = static_cast<std::int64_t>(options_.last - options_.first);
    return intervals > 0 ? sum(span, span / intervals) : 1'000'000'000;
  }

  std::uint64_t lap_sequence() const {
    const auto& records = stream_->records();
    return records[options_.last].sequence - records[options_.first].sequence + 1;
  }

  // Reads ahead of the time it is due, so that decoding does not make the frame late.
  bool load() {
    if (index_ > options_.last) {
      if (!options_.loop) return false;
      index_ = options_.first;
      ++lap_;
    }
    try {
      pending_ = on_this_lap(stream_->read(index_));
    } catch (const Error& error) {
      pending_ = DeviceTrouble{name_, std::string(error.what()) + "; the frame is left out"};
    }
    return true;
  }

  FramePtr on_this_lap(FramePtr recorded) const {
    if (lap_ == 0) return recorded;
    auto frame = std::make_shared<Frame>(*recorded);
    frame->timestamp_ns = sum(frame->timestamp_ns, shift_ns());
    frame->arrival_ns = sum(frame->arrival_ns, shift_ns());
    frame->sequence += static_cast<std::uint64_t>(lap_) * lap_sequence();
    return frame;
  }

  std::unique_ptr<session::StreamReader> stream_;
  std::string name_;
  ReplayOptions options_;
  ReplayClock clock_;
  std::deque<std::string> trouble_;
  std::size_t index_ = 0;  // of the pending frame, or the next to load
  std::int64_t lap_ = 0;
  std::optional<CameraEvent> pending_;
};

}  // namespace

std::unique_ptr<Camera> replay(std::unique_ptr<session::StreamReader> stream, std::string name,
                               const ReplayOptions& options, const ReplayClock& clock,
                               const std::vector<std::string>& trouble) {
  return std::make_unique<ReplayCamera>(std::move(stream), std::move(name), options, clock,
                                        trouble);
}

std::unique_ptr<Camera> open_replay(const std::filesystem::path& session, const std::string& source,
                                    const ReplayOptions& options, const ReplayClock& clock) {
  session::Session opened = session::open_session(session);
  std::unique_ptr<session::StreamReader> stream = session::open_stream(opened, source);
  const std::string name = (session / source).string();
  if (!stream) throw Error(name + ": the session has no such stream");
  return replay(std::move(stream), name, options, clock, opened.missing);
}

}  // namespace previz
