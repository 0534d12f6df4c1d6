// A HID pad of eight buttons, made through /dev/uhid: to hidraw and hidapi it is real. Does what
// standard input says, a word or two a line; the pad is there from the start to the end of it.
//   press N     release N     unplug     plug          N: 1 to 8
#include <iostream>
#include <memory>
#include <sstream>
#include <string>

#include "tests/devices/uhid_pad.hpp"

namespace {

// With the state of its buttons.
class Pad {
 public:
  void set(int button, bool pressed) {
    const auto bit = static_cast<std::uint8_t>(1u << (button - 1));
    state_ = static_cast<std::uint8_t>(pressed ? state_ | bit : state_ & ~bit);
    pad_.report({&state_, 1});
  }

 private:
  previz::test::UhidPad pad_{"RIG0001"};
  std::uint8_t state_ = 0;
};

}  // namespace

int main() {
  try {
    auto pad = std::make_unique<Pad>();
    for (std::string line; std::getline(std::cin, line);) {
      std::istringstream words(line);
      std::string word;
      int button = 0;
      words >> word >> button;
      const bool edge = word == "press" || word == "release";
      if (edge && pad && button >= 1 && button <= 8)
        pad->set(button, word == "press");
      else if (word == "unplug")
        pad.reset();
      else if (word == "plug")
        pad = std::make_unique<Pad>();
      else
        throw previz::Error("not to be done: " + line);
    }
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "rig_vm_pad: " << error.what() << "\n";
    return 1;
  }
}
