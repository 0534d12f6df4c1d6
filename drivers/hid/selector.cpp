#include "drivers/hid/selector.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstdio>
#include <string_view>

#include "drivers/error.hpp"

namespace previz::hid {
namespace {

constexpr std::size_t longest_report = 4096;  // HID_MAX_BUFFER_SIZE of the kernel, rounded down

[[noreturn]] void refuse(const std::string& text) {
  throw Error("HID button \"" + text +
              "\": allowed: BYTE.BIT, BYTE=HEX and BYTE-BYTE=HEX, preceded by REPORT/ if the "
              "device numbers its reports; `previzd devices --learn` prints them");
}

std::size_t number(std::string_view text, std::size_t most, const std::string& whole,
                   int base = 10) {
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size() || value > most) refuse(whole);
  return value;
}

}  // namespace

bool Selector::too_short(std::span<const std::uint8_t> report_bytes) const {
  if (report && (report_bytes.empty() || report_bytes[0] != *report)) return false;
  return report_bytes.size() <= last;
}

bool Selector::speaks(std::span<const std::uint8_t> report_bytes) const {
  if (report && (report_bytes.empty() || report_bytes[0] != *report)) return false;
  return report_bytes.size() > last;
}

bool Selector::pressed(std::span<const std::uint8_t> report_bytes) const {
  if (bit) return (report_bytes[first] >> *bit & 1) != 0;
  const auto held = report_bytes.subspan(first, last - first + 1);
  return std::ranges::find(held, value) != held.end();
}

Selector parse_selector(const std::string& text) {
  Selector selector;
  std::string_view rest = text;
  if (const std::size_t slash = rest.find('/'); slash != std::string_view::npos) {
    selector.report = static_cast<std::uint8_t>(number(rest.substr(0, slash), 255, text));
    rest = rest.substr(slash + 1);
  }
  if (const std::size_t dot = rest.find('.'); dot != std::string_view::npos) {
    selector.first = selector.last = number(rest.substr(0, dot), longest_report, text);
    selector.bit = static_cast<int>(number(rest.substr(dot + 1), 7, text));
    return selector;
  }
  const std::size_t equals = rest.find('=');
  if (equals == std::string_view::npos) refuse(text);
  selector.value = static_cast<std::uint8_t>(number(rest.substr(equals + 1), 255, text, 16));
  rest = rest.substr(0, equals);
  const std::size_t dash = std::min(rest.find('-'), rest.size());
  selector.first = selector.last = number(rest.substr(0, dash), longest_report, text);
  if (dash < rest.size()) selector.last = number(rest.substr(dash + 1), longest_report, text);
  if (selector.last < selector.first) refuse(text);
  return selector;
}

std::vector<std::string> pressed_between(std::span<const std::uint8_t> before,
                                         std::span<const std::uint8_t> after) {
  std::vector<std::string> selectors;
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    const std::uint8_t changed = before[i] ^ after[i];
    if ((changed & after[i]) == 0) continue;
    if (std::popcount(changed) == 1) {
      selectors.push_back(std::to_string(i) + "." + std::to_string(std::countr_zero(changed)));
    } else {
      char hex[3];
      std::snprintf(hex, sizeof hex, "%02x", after[i]);
      selectors.push_back(std::to_string(i) + "=" + hex);
    }
  }
  return selectors;
}

}  // namespace previz::hid
