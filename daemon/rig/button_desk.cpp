#include "daemon/rig/button_desk.hpp"

#include <algorithm>
#include <utility>
#include <variant>

#include "daemon/rig/controls.hpp"
#include "drivers/button_drivers.hpp"

namespace previz::rig {

ButtonDesk::ButtonDesk(const std::vector<set::Button>& mapped, std::vector<Device> devices,
                       Parts parts, Asks asks)
    : mapped_(mapped), parts_(parts), asks_(std::move(asks)), presses_(mapped) {
  for (Device& device : devices) {
    pipeline::DeviceCounts counts(parts_.metrics, device.buttons->name());
    devices_.push_back({std::move(device), std::move(counts), nullptr, 0});
  }
  for (Watched& watched : devices_)
    watched.watch =
        parts_.loop.on_readable(watched.device.buttons->fd(), [this, &watched] { read(watched); });
}

void ButtonDesk::read(Watched& watched) {
  Buttons& buttons = *watched.device.buttons;
  for (int events = 0; events < most_events_a_turn; ++events) {
    if (!asks_.listens()) return;
    std::optional<ButtonsEvent> event = buttons.next();
    if (!event) return;
    bool over = std::holds_alternative<EndOfStream>(*event);
    if (auto* pushed = std::get_if<ButtonEvent>(&*event)) {
      parts_.reports.settle(buttons.name());
      pushed->timestamp_ns += watched.device.clock_offset_ns;
      edge(*pushed);
    }
    if (const auto* trouble = std::get_if<DeviceTrouble>(&*event)) {
      parts_.reports(report::counted({.severity = report::Severity::error,
                                      .source = trouble->device,
                                      .text = trouble->what,
                                      .notice = report::lasting(buttons.name(), trouble->what)}));
      over = trouble->lost;
    }
    if (over) return watched.watch.reset();
  }
  ++watched.full_turns;
}

void ButtonDesk::edge(const ButtonEvent& event) {
  const bool ended = asks_.edge(event);
  if (event.pressed && ended) ended_refinement_.insert(event.button);
  if (event.pressed && !ended) ended_refinement_.erase(event.button);
  for (const Press& press : presses_.edge(event)) act(press);
}

void ButtonDesk::act(const Press& press) {
  const auto mapped = std::ranges::find_if(mapped_, [&](const set::Button& button) {
    return button.name == press.button && button.press == press.kind;
  });
  if (mapped == mapped_.end()) return;
  const set::Action& action = *set::find_action(mapped->action);
  // A press that ended the refinement has already changed the mode, to live.
  const bool ended_refinement = ended_refinement_.erase(press.button) > 0;
  if (ended_refinement && Controls::is_mode(action)) return;
  asks_.act(action, press.button, ended_refinement);
}

void ButtonDesk::tick(std::int64_t now_ns) {
  for (const Press& press : presses_.tick(now_ns)) act(press);
}

void ButtonDesk::count() {
  for (Watched& watched : devices_) {
    DeviceCounters counters = watched.device.buttons->counters();
    if (watched.full_turns > 0) counters["event bursts larger than one read"] = watched.full_turns;
    watched.counts.update(counters);
  }
}

std::vector<ButtonDesk::Device> open_button_devices(
    const set::Set& set, const live::Cameras& cameras,
    const std::function<std::vector<std::unique_ptr<Buttons>>()>& more) {
  std::vector<ButtonDesk::Device> devices;
  const auto add = [&](std::vector<std::unique_ptr<Buttons>> opened, std::int64_t offset_ns) {
    for (std::unique_ptr<Buttons>& buttons : opened)
      devices.push_back({std::move(buttons), offset_ns});
  };
  add(live::open_buttons(set, cameras), 0);
  std::vector<std::string> plugged;
  for (const set::Button& button : set.buttons)
    if (is_button_name(button.name) && std::ranges::find(plugged, button.name) == plugged.end())
      plugged.push_back(button.name);
  ButtonSettings settings;
  for (const set::GpioContact& contact : set.contacts)
    settings.wiring[contact.name] = contact.wiring;
  add(previz::open_buttons(plugged, settings), cameras.clock_offset_ns);
  if (more) add(more(), 0);
  return devices;
}

}  // namespace previz::rig
