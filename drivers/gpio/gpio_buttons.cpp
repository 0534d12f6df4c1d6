#include "drivers/gpio/gpio_buttons.hpp"

#include <gpiod.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <ctime>
#include <deque>
#include <list>
#include <optional>
#include <utility>

#include "drivers/debouncer.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"
#include "drivers/host_clock.hpp"

namespace previz {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr const char* consumer = "previzd";
// A contact that chatters faster than it is read must not hold up whoever reads it.
constexpr int most_edges_at_once = 64;
// The kernel keeps as many edges of a line, and drops those that follow.
constexpr int edges_kept = 16;

struct CloseChip {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }  // also releases its lines
};
using Chip = std::unique_ptr<gpiod_chip, CloseChip>;

std::int64_t edge_ns(const timespec& time) {
  return std::int64_t{time.tv_sec} * second_ns + time.tv_nsec;
}

struct Contact {
  std::string chip, line;
};

// Splits gpio:CHIP:LINE; a chip's label may have colons ("INTC1057:00").
Contact contact_of(const std::string& name) {
  const std::size_t begin = name.find(':') + 1, end = name.rfind(':');
  if (end <= begin || end + 1 == name.size())
    throw Error("button \"" + name + "\": allowed: gpio:CHIP:LINE, CHIP is its label");
  return {name.substr(begin, end - begin), name.substr(end + 1)};
}

// Finds a chip by its label only, because the number of a gpiochip changes from boot to boot.
Chip find_chip(const std::string& label) {
  Chip chip(gpiod_chip_open_by_label(label.c_str()));
  if (!chip) throw Error("no GPIO chip has the label \"" + label + "\": " + std::strerror(errno));
  return chip;
}

gpiod_line* find_line(gpiod_chip& chip, const std::string& line) {
  unsigned offset = 0;
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), offset);
  gpiod_line* found = error == std::errc{} && end == line.data() + line.size()
                          ? gpiod_chip_get_line(&chip, offset)
                          : gpiod_chip_find_line(&chip, line.c_str());
  if (!found) throw Error("the chip has no line \"" + line + "\"");
  return found;
}

int request_flags(const ContactWiring& wiring) {
  using Bias = ContactWiring::Bias;
  int flags = wiring.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (wiring.bias == Bias::none) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE;
  if (wiring.bias == Bias::pull_up) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
  if (wiring.bias == Bias::pull_down) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
  return flags;
}

class GpioButtons final : public Buttons {
 public:
  GpioButtons(std::string device, const std::vector<std::string>& names,
              const ButtonSettings& settings)
      : device_(std::move(device)),
        epoll_(epoll_create1(EPOLL_CLOEXEC)),
        timer_(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {
    if (!epoll_ || !timer_) throw Error(device_ + ": cannot be polled: " + std::strerror(errno));
    for (const std::string& name : names) {
      const ContactWiring wiring = settings.wiring_of(name);
      lines_.push_back({name, contact_of(name).line, request_flags(wiring), nullptr,
                        Debouncer(static_cast<std::int64_t>(1e9 * wiring.debounce_s)), 0, 0});
    }
    watch(timer_.get());
    arm();
  }

  std::string name() const override { return device_; }
  int fd() const override { return epoll_.get(); }
  DeviceCounters counters() const override { return counters_; }

  std::optional<ButtonsEvent> next() override {
    if (!chip_ && monotonic_ns() >= retry_ns_) open();
    if (events_.empty()) {
      for (Line& line : lines_) {
        if (line.debouncer.settle(monotonic_ns())) push_edge(line);
        read(line);
        look_for_babble(line);
      }
    }
    if (events_.empty()) {
      arm();
      return std::nullopt;
    }
    ButtonsEvent event = std::move(events_.front());
    events_.pop_front();
    arm();
    return event;
  }

 private:
  struct Line {
    std::string name;   // name of the button
    std::string label;  // name or offset of the line
    int request_flags;
    gpiod_line* line;  // owned by chip_; null while it is not there
    Debouncer debouncer;
    std::uint64_t times_babbled = 0, presses_left_out = 0;  // as counted so far
  };

  void watch(int descriptor) {
    epoll_event interest{};
    interest.events = EPOLLIN;
    epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, descriptor, &interest);
  }

  void open() {
    try {
      Chip chip = find_chip(device_.substr(device_.find(':') + 1));
      for (Line& line : lines_) request(*chip, line);
      chip_ = std::move(chip);
      refusal_.clear();
      for (Line& line : lines_) see_held(line);
      ++counters_["opened"];
    } catch (const std::exception& error) {
      for (Line& line : lines_) line.line = nullptr;
      chip_.reset();
      retry_ns_ = monotonic_ns() + second_ns;
      ++counters_["not opened"];
      if (refusal_ == error.what()) return;
      refusal_ = error.what();
      events_.emplace_back(DeviceTrouble{device_, refusal_ + "; retrying until it is available"});
    }
  }

  void request(gpiod_chip& chip, Line& line) {
    line.line = find_line(chip, line.label);
    if (gpiod_line_request_both_edges_events_flags(line.line, consumer, line.request_flags) != 0)
      throw Error("line \"" + line.label + "\" is not available: " + std::strerror(errno));
    watch(gpiod_line_event_get_fd(line.line));
  }

  // A button that is held while the rig starts counts as pressed from now on.
  void see_held(Line& line) {
    if (gpiod_line_get_value(line.line) == 1 && line.debouncer.edge(true, monotonic_ns()))
      push_edge(line);
  }

  void read(Line& line) {
    constexpr timespec at_once{0, 0};
    int edges = 0;
    while (line.line && edges < most_edges_at_once &&
           gpiod_line_event_wait(line.line, &at_once) == 1) {
      gpiod_line_event edge{};
      if (gpiod_line_event_read(line.line, &edge) != 0) return lose(std::strerror(errno));
      if (line.debouncer.edge(edge.event_type == GPIOD_LINE_EVENT_RISING_EDGE, edge_ns(edge.ts)))
        push_edge(line);
      ++edges;
    }
    if (edges >= edges_kept) see_level(line);
  }

  // The last edge may be among those that the kernel dropped.
  void see_level(Line& line) {
    const int level = gpiod_line_get_value(line.line);
    if (level >= 0 && line.debouncer.edge(level == 1, monotonic_ns())) push_edge(line);
  }

  void look_for_babble(Line& line) {
    const Debouncer& contact = line.debouncer;
    counters_[presses_babbled] += contact.presses_left_out() - line.presses_left_out;
    line.presses_left_out = contact.presses_left_out();
    if (std::exchange(line.times_babbled, contact.times_babbled()) != contact.times_babbled())
      events_.emplace_back(babbling(device_, line.name));
  }

  void lose(const std::string& why) {
    for (Line& line : lines_) {
      line.line = nullptr;
      if (line.debouncer.pressed())
        events_.emplace_back(ButtonEvent{line.name, false, monotonic_ns()});
      line.debouncer.reset();
    }
    chip_.reset();
    retry_ns_ = monotonic_ns() + second_ns;
    ++counters_["lost"];
    events_.emplace_back(DeviceTrouble{device_, "is lost: " + why + "; retrying"});
  }

  void push_edge(const Line& line) {
    events_.emplace_back(
        ButtonEvent{line.name, line.debouncer.pressed(), line.debouncer.told_ns()});
  }

  // The timer wakes for what the lines themselves do not signal: events that wait, a contact that
  // will settle, a chip to look for, and one that has gone (the kernel then fails reads, but wakes
  // nobody).
  void arm() {
    std::optional<std::int64_t> due_ns;
    const auto at = [&](std::int64_t time_ns) {
      due_ns = std::min(due_ns.value_or(time_ns), time_ns);
    };
    if (!events_.empty()) at(1);
    at(chip_ ? monotonic_ns() + second_ns : std::max<std::int64_t>(1, retry_ns_));
    for (const Line& line : lines_)
      if (line.debouncer.settles_ns()) at(*line.debouncer.settles_ns());
    itimerspec spec{};
    if (due_ns) spec.it_value = {*due_ns / second_ns, *due_ns % second_ns};
    timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &spec, nullptr);
  }

  const std::string device_;
  OwnedDescriptor epoll_, timer_;
  Chip chip_;
  std::int64_t retry_ns_ = 0;
  std::string refusal_;  // trouble last reported
  std::list<Line> lines_;
  std::deque<ButtonsEvent> events_;
  DeviceCounters counters_{{"opened", 0}, {"not opened", 0}, {"lost", 0}, {presses_babbled, 0}};
};

std::string or_empty(const char* text) {
  return text ? text : "";
}

}  // namespace

std::string gpio_device_of(const std::string& name) {
  return "gpio:" + contact_of(name).chip;
}

std::unique_ptr<Buttons> open_gpio(const std::string& device, const std::vector<std::string>& names,
                                   const ButtonSettings& settings) {
  return std::make_unique<GpioButtons>(device, names, settings);
}

std::vector<FoundButton> find_gpio() {
  std::vector<FoundButton> found;
  gpiod_chip_iter* chips = gpiod_chip_iter_new();
  if (!chips) return found;
  while (gpiod_chip* chip = gpiod_chip_iter_next(chips)) {
    const std::string label = or_empty(gpiod_chip_label(chip));
    for (unsigned i = 0; i < gpiod_chip_num_lines(chip); ++i) {
      gpiod_line* line = gpiod_chip_get_line(chip, i);
      if (!line || gpiod_line_is_used(line)) continue;
      if (gpiod_line_direction(line) != GPIOD_LINE_DIRECTION_INPUT) continue;
      const std::string name = or_empty(gpiod_line_name(line));
      if (!name.empty())
        found.push_back({"gpio:" + label + ":" + name,
                         or_empty(gpiod_chip_name(chip)) + " line " + std::to_string(i)});
    }
  }
  gpiod_chip_iter_free(chips);
  return found;
}

}  // namespace previz
