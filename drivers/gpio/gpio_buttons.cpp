#include "drivers/gpio/gpio_buttons.hpp"

#include <sys/epoll.h>
#include <sys/timerfd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>
#include <list>
#include <optional>
#include <utility>

#include "drivers/debouncer.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"
#include "drivers/gpio/chip.hpp"
#include "drivers/host_clock.hpp"

namespace previz {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
// A contact that chatters faster than it is read must not hold up whoever reads it.
constexpr int most_edges_at_once = 64;

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
      lines_.push_back({name, contact_of(name).line, wiring, std::nullopt,
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
    ContactWiring wiring;
    std::optional<gpio::Input> input;  // while chip_ is there
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
      chip_.emplace(device_.substr(device_.find(':') + 1));
      for (Line& line : lines_) {
        line.input = chip_->take(line.label, line.wiring);
        watch(line.input->fd());
      }
      refusal_.clear();
      for (Line& line : lines_) see_held(line);
      ++counters_["opened"];
    } catch (const std::exception& error) {
      release();
      retry_ns_ = monotonic_ns() + second_ns;
      ++counters_["not opened"];
      if (refusal_ == error.what()) return;
      refusal_ = error.what();
      events_.emplace_back(DeviceTrouble{device_, refusal_ + "; retrying until it is available"});
    }
  }

  void release() {
    for (Line& line : lines_) line.input.reset();
    chip_.reset();
  }

  // A button that is held while the rig starts counts as pressed from now on.
  void see_held(Line& line) {
    if (line.input->is_active().value_or(false) && line.debouncer.edge(true, monotonic_ns()))
      push_edge(line);
  }

  void read(Line& line) try {
    int edges = 0;
    while (line.input && edges < most_edges_at_once) {
      const std::optional<gpio::Edge> edge = line.input->next_edge();
      if (!edge) break;
      if (line.debouncer.edge(edge->is_active, edge->timestamp_ns)) push_edge(line);
      ++edges;
    }
    if (edges >= gpio::edges_kept) see_level(line);
  } catch (const Error& error) {
    lose(error.what());
  }

  // The last edge may be among those that the kernel dropped.
  void see_level(Line& line) {
    const std::optional<bool> is_active = line.input->is_active();
    if (is_active && line.debouncer.edge(*is_active, monotonic_ns())) push_edge(line);
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
      if (line.debouncer.pressed())
        events_.emplace_back(ButtonEvent{line.name, false, monotonic_ns()});
      line.debouncer.reset();
    }
    release();
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
  std::optional<gpio::Chip> chip_;
  std::int64_t retry_ns_ = 0;
  std::string refusal_;  // trouble last reported
  std::list<Line> lines_;
  std::deque<ButtonsEvent> events_;
  DeviceCounters counters_{{"opened", 0}, {"not opened", 0}, {"lost", 0}, {presses_babbled, 0}};
};

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
  for (const gpio::FreeInput& input : gpio::free_inputs())
    found.push_back({"gpio:" + input.chip_label + ":" + input.line,
                     input.chip_name + " line " + std::to_string(input.number)});
  return found;
}

}  // namespace previz
