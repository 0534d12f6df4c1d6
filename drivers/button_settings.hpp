// The settings that a set gives for its buttons, as plain data.
#pragma once

#include <map>
#include <string>

namespace previz {

// Says how a contact is wired to its GPIO line.
struct ContactWiring {
  enum class Bias { as_is, none, pull_up, pull_down };
  bool active_low = true;  // pressed pulls the line to ground
  Bias bias = Bias::pull_up;
  double debounce_s = 0.005;

  friend bool operator==(const ContactWiring&, const ContactWiring&) = default;
};

struct ButtonSettings {
  // The key is "gpio:CHIP:LINE", or "gpio:CHIP" for all other lines of the chip.
  std::map<std::string, ContactWiring> wiring;

  ContactWiring wiring_of(const std::string& line_name) const {
    for (const std::string& name : {line_name, line_name.substr(0, line_name.rfind(':'))})
      if (const auto found = wiring.find(name); found != wiring.end()) return found->second;
    return {};
  }
};

}  // namespace previz
