// With version 1 of libgpiod.
#include <gpiod.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/gpio/chip.hpp"

namespace previz::gpio {
namespace {

constexpr const char* consumer = "previzd";

std::string or_empty(const char* text) {
  return text ? text : "";
}

int request_flags(const ContactWiring& wiring) {
  using Bias = ContactWiring::Bias;
  int flags = wiring.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (wiring.bias == Bias::none) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_DISABLE;
  if (wiring.bias == Bias::pull_up) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP;
  if (wiring.bias == Bias::pull_down) flags |= GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN;
  return flags;
}

}  // namespace

struct Input::Impl {
  gpiod_line* line = nullptr;  // its chip's

  explicit Impl(gpiod_line* the_line) : line(the_line) {}
  ~Impl() { gpiod_line_release(line); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
};

Input::Input(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Input::~Input() = default;
Input::Input(Input&&) noexcept = default;
Input& Input::operator=(Input&&) noexcept = default;

int Input::fd() const {
  return gpiod_line_event_get_fd(impl_->line);
}

std::optional<bool> Input::is_active() const {
  const int level = gpiod_line_get_value(impl_->line);
  return level < 0 ? std::nullopt : std::optional(level == 1);
}

std::optional<Edge> Input::next_edge() {
  constexpr timespec at_once{0, 0};
  if (gpiod_line_event_wait(impl_->line, &at_once) != 1) return std::nullopt;
  gpiod_line_event edge{};
  if (gpiod_line_event_read(impl_->line, &edge) != 0) throw Error(std::strerror(errno));
  return Edge{edge.event_type == GPIOD_LINE_EVENT_RISING_EDGE,
              std::int64_t{edge.ts.tv_sec} * 1'000'000'000 + edge.ts.tv_nsec};
}

struct Chip::Impl {
  struct Close {
    void operator()(gpiod_chip* opened) const { gpiod_chip_close(opened); }
  };
  std::unique_ptr<gpiod_chip, Close> chip;
};

Chip::Chip(const std::string& label)
    : impl_(new Impl{decltype(Impl::chip)(gpiod_chip_open_by_label(label.c_str()))}) {
  if (!impl_->chip)
    throw Error("no GPIO chip has the label \"" + label + "\": " + std::strerror(errno));
}

Chip::~Chip() = default;

Input Chip::take(const std::string& line, const ContactWiring& wiring) {
  const std::optional<unsigned> number = line_number(line);
  gpiod_line* found = number ? gpiod_chip_get_line(impl_->chip.get(), *number)
                             : gpiod_chip_find_line(impl_->chip.get(), line.c_str());
  if (!found) throw Error("the chip has no line \"" + line + "\"");
  if (gpiod_line_request_both_edges_events_flags(found, consumer, request_flags(wiring)) != 0)
    throw Error("line \"" + line + "\" is not available: " + std::strerror(errno));
  return Input(std::make_unique<Input::Impl>(found));
}

std::vector<FreeInput> free_inputs() {
  std::vector<FreeInput> found;
  gpiod_chip_iter* chips = gpiod_chip_iter_new();
  if (!chips) return found;
  while (gpiod_chip* chip = gpiod_chip_iter_next(chips)) {
    for (unsigned i = 0; i < gpiod_chip_num_lines(chip); ++i) {
      gpiod_line* line = gpiod_chip_get_line(chip, i);
      if (!line || gpiod_line_is_used(line)) continue;
      if (gpiod_line_direction(line) != GPIOD_LINE_DIRECTION_INPUT) continue;
      const std::string name = or_empty(gpiod_line_name(line));
      if (name.empty()) continue;
      found.push_back({or_empty(gpiod_chip_label(chip)), or_empty(gpiod_chip_name(chip)), name, i});
    }
  }
  gpiod_chip_iter_free(chips);
  return found;
}

}  // namespace previz::gpio
