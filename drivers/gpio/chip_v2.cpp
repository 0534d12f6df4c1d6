// With version 2 of libgpiod.
#include <gpiod.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <new>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/gpio/chip.hpp"

namespace previz::gpio {
namespace {

constexpr const char* consumer = "previzd";

template <auto free>
struct Free {
  template <typename T>
  void operator()(T* object) const {
    free(object);
  }
};
using ChipPtr = std::unique_ptr<gpiod_chip, Free<gpiod_chip_close>>;
using ChipInfo = std::unique_ptr<gpiod_chip_info, Free<gpiod_chip_info_free>>;
using LineInfo = std::unique_ptr<gpiod_line_info, Free<gpiod_line_info_free>>;
using Settings = std::unique_ptr<gpiod_line_settings, Free<gpiod_line_settings_free>>;
using LineConfig = std::unique_ptr<gpiod_line_config, Free<gpiod_line_config_free>>;
using RequestConfig = std::unique_ptr<gpiod_request_config, Free<gpiod_request_config_free>>;
using Request = std::unique_ptr<gpiod_line_request, Free<gpiod_line_request_release>>;
using Edges = std::unique_ptr<gpiod_edge_event_buffer, Free<gpiod_edge_event_buffer_free>>;

std::string or_empty(const char* text) {
  return text ? text : "";
}

// Returns the chips' files in order.
std::vector<std::string> chip_files() {
  std::vector<std::string> files;
  std::error_code unreadable;
  for (std::filesystem::directory_iterator file("/dev", unreadable), end;
       !unreadable && file != end; file.increment(unreadable))
    if (gpiod_is_gpiochip_device(file->path().c_str())) files.push_back(file->path());
  std::ranges::sort(files);
  return files;
}

ChipPtr find_chip(const std::string& label) {
  int reason = ENOENT;
  for (const std::string& file : chip_files()) {
    ChipPtr chip(gpiod_chip_open(file.c_str()));
    const ChipInfo info(chip ? gpiod_chip_get_info(chip.get()) : nullptr);
    if (!info) reason = errno;
    if (info && label == gpiod_chip_info_get_label(info.get())) return chip;
  }
  throw Error("no GPIO chip has the label \"" + label + "\": " + std::strerror(reason));
}

gpiod_line_bias bias_of(ContactWiring::Bias bias) {
  switch (bias) {
    case ContactWiring::Bias::as_is:
      return GPIOD_LINE_BIAS_AS_IS;
    case ContactWiring::Bias::none:
      return GPIOD_LINE_BIAS_DISABLED;
    case ContactWiring::Bias::pull_up:
      return GPIOD_LINE_BIAS_PULL_UP;
    case ContactWiring::Bias::pull_down:
      return GPIOD_LINE_BIAS_PULL_DOWN;
  }
  return GPIOD_LINE_BIAS_AS_IS;
}

// Throws std::bad_alloc where there is no memory for libgpiod's objects.
template <typename Owner, typename Object>
Owner owned(Object* object) {
  if (!object) throw std::bad_alloc();
  return Owner(object);
}

Request request_input(gpiod_chip& chip, unsigned number, const ContactWiring& wiring) {
  const auto settings = owned<Settings>(gpiod_line_settings_new());
  gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_INPUT);
  gpiod_line_settings_set_edge_detection(settings.get(), GPIOD_LINE_EDGE_BOTH);
  gpiod_line_settings_set_bias(settings.get(), bias_of(wiring.bias));
  gpiod_line_settings_set_active_low(settings.get(), wiring.active_low);
  const auto lines = owned<LineConfig>(gpiod_line_config_new());
  if (gpiod_line_config_add_line_settings(lines.get(), &number, 1, settings.get()) != 0)
    return nullptr;
  const auto request = owned<RequestConfig>(gpiod_request_config_new());
  gpiod_request_config_set_consumer(request.get(), consumer);
  gpiod_request_config_set_event_buffer_size(request.get(), edges_kept);
  return Request(gpiod_chip_request_lines(&chip, request.get(), lines.get()));
}

}  // namespace

struct Input::Impl {
  Request request;
  unsigned number = 0;
  Edges edges = owned<Edges>(gpiod_edge_event_buffer_new(1));
};

Input::Input(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Input::~Input() = default;
Input::Input(Input&&) noexcept = default;
Input& Input::operator=(Input&&) noexcept = default;

int Input::fd() const {
  return gpiod_line_request_get_fd(impl_->request.get());
}

std::optional<bool> Input::is_active() const {
  const gpiod_line_value level = gpiod_line_request_get_value(impl_->request.get(), impl_->number);
  if (level == GPIOD_LINE_VALUE_ERROR) return std::nullopt;
  return level == GPIOD_LINE_VALUE_ACTIVE;
}

std::optional<Edge> Input::next_edge() {
  if (gpiod_line_request_wait_edge_events(impl_->request.get(), 0) != 1) return std::nullopt;
  if (gpiod_line_request_read_edge_events(impl_->request.get(), impl_->edges.get(), 1) != 1)
    throw Error(std::strerror(errno));
  gpiod_edge_event* edge = gpiod_edge_event_buffer_get_event(impl_->edges.get(), 0);
  return Edge{gpiod_edge_event_get_event_type(edge) == GPIOD_EDGE_EVENT_RISING_EDGE,
              static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(edge))};
}

struct Chip::Impl {
  ChipPtr chip;
};

Chip::Chip(const std::string& label) : impl_(new Impl{find_chip(label)}) {}
Chip::~Chip() = default;

Input Chip::take(const std::string& line, const ContactWiring& wiring) {
  gpiod_chip* chip = impl_->chip.get();
  const std::optional<unsigned> given = line_number(line);
  const int number =
      given ? static_cast<int>(*given) : gpiod_chip_get_line_offset_from_name(chip, line.c_str());
  const ChipInfo info(gpiod_chip_get_info(chip));
  if (number < 0 || !info ||
      static_cast<unsigned>(number) >= gpiod_chip_info_get_num_lines(info.get()))
    throw Error("the chip has no line \"" + line + "\"");
  Request request = request_input(*chip, static_cast<unsigned>(number), wiring);
  if (!request) throw Error("line \"" + line + "\" is not available: " + std::strerror(errno));
  auto input = std::make_unique<Input::Impl>();
  input->request = std::move(request);
  input->number = static_cast<unsigned>(number);
  return Input(std::move(input));
}

std::vector<FreeInput> free_inputs() {
  std::vector<FreeInput> found;
  for (const std::string& file : chip_files()) {
    const ChipPtr chip(gpiod_chip_open(file.c_str()));
    const ChipInfo info(chip ? gpiod_chip_get_info(chip.get()) : nullptr);
    if (!info) continue;
    for (unsigned i = 0; i < gpiod_chip_info_get_num_lines(info.get()); ++i) {
      const LineInfo line(gpiod_chip_get_line_info(chip.get(), i));
      if (!line || gpiod_line_info_is_used(line.get())) continue;
      if (gpiod_line_info_get_direction(line.get()) != GPIOD_LINE_DIRECTION_INPUT) continue;
      const std::string name = or_empty(gpiod_line_info_get_name(line.get()));
      if (name.empty()) continue;
      found.push_back({or_empty(gpiod_chip_info_get_label(info.get())),
                       or_empty(gpiod_chip_info_get_name(info.get())), name, i});
    }
  }
  return found;
}

}  // namespace previz::gpio
