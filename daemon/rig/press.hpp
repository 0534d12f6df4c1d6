// Recognises short, long and double presses from the edges of buttons.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "drivers/buttons.hpp"

namespace previz::rig {

struct Press {
  std::string button;
  set::PressKind kind = set::PressKind::short_press;
  std::int64_t timestamp_ns = 0;  // when the kind became certain

  friend bool operator==(const Press&, const Press&) = default;
};

// A press is returned as soon as its kind is certain, so a button that only has a short press
// answers at once. If it has a long press too, a short one is certain at its release, and a long
// one while the button is still held. If it has a double press, a short one is certain only once
// the time for a second push has passed. Time comes from the caller.
class PressRecognizer {
 public:
  static constexpr std::int64_t long_ns = 600'000'000;    // a press held so long is long
  static constexpr std::int64_t double_ns = 300'000'000;  // from release to the second push

  // `buttons` says which presses have an action. A button that has none is never returned.
  explicit PressRecognizer(const std::vector<set::Button>& buttons);

  // Edges of one button must come in the order of time; those of different buttons need not.
  std::vector<Press> edge(const ButtonEvent& event);
  // Returns the presses that became certain by the passing of time. Call it every few hundredths of
  // a second.
  std::vector<Press> tick(std::int64_t now_ns);

 private:
  enum class Phase { idle, down, certain, released };
  struct Button {
    bool has_short = false, has_long = false, has_double = false;
    Phase phase = Phase::idle;
    std::int64_t since_ns = 0;  // begin of the phase
  };

  static std::optional<std::int64_t> due(const Button& button);
  static void push(const std::string& name, Button& button, std::int64_t now_ns,
                   std::vector<Press>& presses);
  static void release(const std::string& name, Button& button, std::int64_t now_ns,
                      std::vector<Press>& presses);

  std::map<std::string, Button> buttons_;
};

}  // namespace previz::rig
