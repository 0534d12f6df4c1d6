// The tables of buttons and of the display.
#include <algorithm>
#include <map>

#include "daemon/core/set/resolving.hpp"
#include "drivers/button_drivers.hpp"
#include "drivers/display_drivers.hpp"
#include "drivers/error.hpp"

namespace previz::set {
namespace {

// Refuses a name that no driver takes, since nobody would notice the typing error. The buttons of
// a replayed session may have any name without a colon.
void pressable(Resolving& work, const Given& table, const std::string& name) {
  const bool may_be_recorded =
      work.set.observer.driver == replay_driver && name.find(':') == std::string::npos;
  if (name.empty() || may_be_recorded) return;
  try {
    check_button_name(name);
  } catch (const Error& error) {
    work.problem(table, "name", error.what());
  }
}

void buttons(Resolving& work) {
  std::map<std::pair<std::string, PressKind>, Position> first;
  for (const auto& [table, button] : work.draft.buttons) {
    if (table.good("name")) {
      if (button.name.empty()) work.problem(table, "name", "is empty; allowed: text");
      if (work.origin == Origin::crew) pressable(work, table, button.name);
      work.once(
          first, std::pair(button.name, button.press), table, "name",
          std::string("a ") + name_of(button.press) + " press of " + codec::quote(button.name),
          "one action per press");
    }
    work.set.buttons.push_back(button);
  }
}

// Refuses wiring that no button uses, since nobody would notice the typing error.
void contacts(Resolving& work) {
  std::map<std::string, Position> first;
  for (const auto& [table, contact] : work.draft.contacts) {
    if (!table.good("name")) continue;
    const std::string quoted = codec::quote(contact.name);
    const auto [other, fresh] = first.emplace(contact.name, table.where("name"));
    const std::string& name = contact.name;  // clang 14 captures no structured binding
    const bool wires_a_button =
        std::ranges::any_of(work.set.buttons, [&name](const Button& button) {
          return button.name == name || button.name.starts_with(name + ':');
        });
    if (!contact.name.starts_with("gpio:"))
      work.problem(table, "name",
                   quoted + " is not a GPIO line; allowed: gpio:CHIP or gpio:CHIP:LINE");
    else if (!fresh)
      work.problem(table, "name",
                   quoted + " is already on line " + std::to_string(other->second.line) +
                       "; allowed: each name once");
    else if (!wires_a_button)
      work.problem(table, "name",
                   quoted +
                       " has no [[button]]; allowed: a button's name, or its part before the "
                       "last colon");
    work.set.contacts.push_back(contact);
  }
}

void display(Resolving& work) {
  const Display& display = work.set.display;
  if (drives_connectors(display.driver)) return;
  const std::string no = "driver \"" + display.driver + "\" has no ";
  work.exclude(work.given("display"), {"connector"}, no + "connector; remove it");
  if (display.driver == no_driver)
    work.exclude(work.given("display"), {"mode"}, no + "mode; remove it");
}

}  // namespace

void resolve_controls(Resolving& work) {
  buttons(work);
  contacts(work);
  display(work);
}

}  // namespace previz::set
