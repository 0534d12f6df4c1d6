#include "daemon/rig/press.hpp"

#include <algorithm>

namespace previz::rig {

using set::PressKind;

PressRecognizer::PressRecognizer(const std::vector<set::Button>& buttons) {
  for (const set::Button& button : buttons) {
    Button& known = buttons_[button.name];
    known.has_short |= button.press == PressKind::short_press;
    known.has_long |= button.press == PressKind::long_press;
    known.has_double |= button.press == PressKind::double_press;
  }
}

std::vector<Press> PressRecognizer::edge(const ButtonEvent& event) {
  std::vector<Press> presses = tick(event.timestamp_ns);
  const auto found = buttons_.find(event.button);
  if (found == buttons_.end()) return presses;
  if (event.pressed)
    push(event.button, found->second, event.timestamp_ns, presses);
  else
    release(event.button, found->second, event.timestamp_ns, presses);
  return presses;
}

void PressRecognizer::push(const std::string& name, Button& button, std::int64_t now_ns,
                           std::vector<Press>& presses) {
  button.since_ns = now_ns;
  if (button.phase == Phase::released) {
    presses.push_back({name, PressKind::double_press, now_ns});
    button.phase = Phase::certain;
  } else if (!button.has_long && !button.has_double) {
    presses.push_back({name, PressKind::short_press, now_ns});
    button.phase = Phase::certain;
  } else {
    button.phase = Phase::down;
  }
}

void PressRecognizer::release(const std::string& name, Button& button, std::int64_t now_ns,
                              std::vector<Press>& presses) {
  const bool may_double = button.phase == Phase::down && button.has_double;
  if (button.phase == Phase::down && !may_double && button.has_short)
    presses.push_back({name, PressKind::short_press, now_ns});
  button.phase = may_double ? Phase::released : Phase::idle;
  button.since_ns = now_ns;
}

std::optional<std::int64_t> PressRecognizer::due(const Button& button) {
  if (button.phase == Phase::down && button.has_long) return button.since_ns + long_ns;
  if (button.phase == Phase::released) return button.since_ns + double_ns;
  return std::nullopt;
}

std::vector<Press> PressRecognizer::tick(std::int64_t now_ns) {
  std::vector<Press> presses;
  for (auto& [name, button] : buttons_) {
    const std::optional<std::int64_t> at = due(button);
    if (!at || *at > now_ns) continue;
    if (button.phase == Phase::down) {
      presses.push_back({name, PressKind::long_press, *at});
      button.phase = Phase::certain;
    } else {
      if (button.has_short) presses.push_back({name, PressKind::short_press, *at});
      button.phase = Phase::idle;
    }
  }
  std::ranges::stable_sort(presses, {}, &Press::timestamp_ns);
  return presses;
}

}  // namespace previz::rig
