// Says which part of a HID report is a button.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace previz::hid {

// "2.5": bit 5 of byte 2 is set (pads, pedals, macro keys). "2-7=1e": one of the bytes 2 to 7 is
// 0x1e (keyboards, and pedals that say they are one: there the bytes are the keys held). "3/2.5":
// only in reports whose first byte is 3, for devices that number their reports.
struct Selector {
  std::optional<std::uint8_t> report;  // the first byte
  std::size_t first = 0, last = 0;     // indices of bytes
  std::optional<int> bit;              // none: the bytes are compared with `value`
  std::uint8_t value = 0;

  // Returns whether the report concerns this button and is long enough for it.
  bool speaks(std::span<const std::uint8_t> report_bytes) const;
  bool too_short(std::span<const std::uint8_t> report_bytes) const;
  // Returns whether the button is pressed; the report must be one that speaks() of it.
  bool pressed(std::span<const std::uint8_t> report_bytes) const;
};

// Throws previz::Error that quotes the text and says what is allowed.
Selector parse_selector(const std::string& text);

// Returns the selectors of what went down from one report to the next of the same length: one for
// each bit that was set, and one for each byte that took a new value and is no single bit.
std::vector<std::string> pressed_between(std::span<const std::uint8_t> before,
                                         std::span<const std::uint8_t> after);

}  // namespace previz::hid
