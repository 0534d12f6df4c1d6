// Keeps the events of buttons until somebody takes them, in bounded memory.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <variant>

#include "drivers/buttons.hpp"

namespace previz {

// A full queue leaves presses and troubles out. The release of a press that was left out is left
// out as well, and that of any other press is kept, so that no button seems to be held for ever.
class ButtonQueue {
 public:
  static constexpr std::size_t most = 256;  // besides the releases of what is pressed

  // Returns false for an event that is left out.
  bool push(ButtonsEvent event) {
    const auto* edge = std::get_if<ButtonEvent>(&event);
    if (edge && !edge->pressed && left_out_.erase(edge->button) > 0) return false;
    const bool release = edge && !edge->pressed;
    if (events_.size() >= most && !release) {
      if (edge) left_out_.insert(edge->button);
      return false;
    }
    events_.push_back(std::move(event));
    return true;
  }

  std::optional<ButtonsEvent> pop() {
    if (events_.empty()) return std::nullopt;
    ButtonsEvent event = std::move(events_.front());
    events_.pop_front();
    return event;
  }

 private:
  std::deque<ButtonsEvent> events_;
  std::set<std::string> left_out_;  // buttons whose present press was left out
};

}  // namespace previz
