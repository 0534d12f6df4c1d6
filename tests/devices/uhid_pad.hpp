// A pad of eight buttons made through /dev/uhid: to hidraw and hidapi it is real.
#pragma once

#include <fcntl.h>
#include <linux/uhid.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::test {

// The report descriptor of a pad of eight buttons, a bit each.
inline constexpr auto eight_buttons = std::to_array<std::uint8_t>(
    {0x06, 0x00, 0xff, 0x09, 0x01, 0xa1, 0x01,  // vendor's page, application
     0x05, 0x09, 0x19, 0x01, 0x29, 0x08,        // buttons 1 to 8
     0x15, 0x00, 0x25, 0x01, 0x75, 0x01, 0x95, 0x08, 0x81, 0x02, 0xc0});

// hid:1209:0001:SERIAL:0.0 is its first button. Plugged in while it lives.
class UhidPad {
 public:
  static bool possible() { return access("/dev/uhid", W_OK) == 0; }

  // `serial`: at most 63 characters. Throws previz::Error where the kernel refuses.
  explicit UhidPad(const std::string& serial) : uhid_(open("/dev/uhid", O_RDWR | O_CLOEXEC)) {
    uhid_event event{};
    event.type = UHID_CREATE2;
    std::string("previzd test pad").copy(reinterpret_cast<char*>(event.u.create2.name), 127);
    serial.copy(reinterpret_cast<char*>(event.u.create2.uniq), 63);
    event.u.create2.rd_size = eight_buttons.size();
    event.u.create2.bus = 3;  // USB
    event.u.create2.vendor = 0x1209;
    event.u.create2.product = 0x0001;
    std::ranges::copy(eight_buttons, event.u.create2.rd_data);
    send(event);
  }

  // The first byte has a bit a button; reports of wrong lengths are for tests.
  void report(std::span<const std::uint8_t> bytes) const {
    uhid_event event{};
    event.type = UHID_INPUT2;
    event.u.input2.size = static_cast<__u16>(bytes.size());
    std::memcpy(event.u.input2.data, bytes.data(), bytes.size());
    send(event);
  }

 private:
  void send(const uhid_event& event) const {
    if (write(uhid_.get(), &event, sizeof event) != static_cast<ssize_t>(sizeof event))
      throw Error(std::string("/dev/uhid: ") + std::strerror(errno));
  }

  OwnedDescriptor uhid_;
};

}  // namespace previz::test
