#include "daemon/core/session/replay_buttons.hpp"

#include <sys/timerfd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <deque>
#include <utility>

#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/missing.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz {
namespace {

using Clock = std::chrono::steady_clock;  // CLOCK_MONOTONIC in libstdc++, as the timer's

class ReplayButtons final : public Buttons {
 public:
  ReplayButtons(std::vector<ButtonEvent> events, std::string name,
                const ReplayButtonsOptions& options)
      : name_(std::move(name)), options_(options) {
    if (!std::isfinite(options.speed) || options.speed < 0)
      throw Error(name_ + ": replay speed " + std::to_string(options.speed) +
                  " is not allowed; 0 or more is");
    std::ranges::stable_sort(events, {}, &ButtonEvent::timestamp_ns);
    for (ButtonEvent& event : events) waiting_.emplace_back(std::move(event));
    waiting_.emplace_back(EndOfStream{});
    timer_ = OwnedDescriptor(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK));
    if (!timer_) throw Error(name_ + ": cannot create a timer: " + std::strerror(errno));
    arm();
  }

  std::string name() const override { return name_; }
  int fd() const override { return timer_.get(); }

  std::optional<ButtonsEvent> next() override {
    if (waiting_.empty() || due() > Clock::now()) return std::nullopt;
    ButtonsEvent event = std::move(waiting_.front());
    waiting_.pop_front();
    arm();
    return event;
  }

  void put_first(const std::string& what) {
    waiting_.emplace_front(DeviceTrouble{name_, what});
    arm();
  }

 private:
  // Trouble and the end are due at once.
  Clock::time_point due() const {
    const auto* event = std::get_if<ButtonEvent>(&waiting_.front());
    if (!event || options_.speed == 0) return {};
    constexpr double one_year_ns = 366.0 * 86'400e9;
    const double elapsed_ns =
        static_cast<double>(event->timestamp_ns) - static_cast<double>(options_.timestamp_ns);
    const double wait_ns = std::clamp(elapsed_ns / options_.speed, -one_year_ns, one_year_ns);
    return options_.due + std::chrono::nanoseconds(static_cast<std::int64_t>(wait_ns));
  }

  // Setting the timer also takes back that it has expired; all zero is "never".
  void arm() {
    itimerspec spec{};
    if (!waiting_.empty()) {
      const std::int64_t ns = std::max<std::int64_t>(
          1,
          std::chrono::duration_cast<std::chrono::nanoseconds>(due().time_since_epoch()).count());
      spec.it_value = {ns / 1'000'000'000, ns % 1'000'000'000};
    }
    timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &spec, nullptr);
  }

  const std::string name_;
  const ReplayButtonsOptions options_;
  std::deque<ButtonsEvent> waiting_;
  OwnedDescriptor timer_;
};

}  // namespace

std::unique_ptr<Buttons> replay_buttons(std::vector<ButtonEvent> events, std::string name,
                                        const ReplayButtonsOptions& options) {
  return std::make_unique<ReplayButtons>(std::move(events), std::move(name), options);
}

std::unique_ptr<Buttons> open_replay_buttons(const std::filesystem::path& session,
                                             const ReplayButtonsOptions& options) {
  const std::filesystem::path file = session / "events.jsonl";
  session::Lines<ButtonEvent> lines = session::read_button_lines(file);
  auto buttons = std::make_unique<ReplayButtons>(std::move(lines.records), file.string(), options);
  if (!lines.bad_lines.empty())
    buttons->put_first(session::list_of("line", lines.bad_lines) + " unreadable, skipped");
  return buttons;
}

}  // namespace previz
