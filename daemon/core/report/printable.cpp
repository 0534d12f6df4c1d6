#include "daemon/core/report/printable.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace previz {
namespace {

struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  // 0: what stands there is not UTF-8
};

// Decodes the character that begins at `at` (RFC 3629).
Character character_at(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t index) -> std::uint32_t {
    return static_cast<unsigned char>(text[index]);
  };
  const std::uint32_t first = byte(at);
  if (first < 0x80) return {first, 1};
  const std::size_t bytes = first >= 0xf8   ? 0
                            : first >= 0xf0 ? 4
                            : first >= 0xe0 ? 3
                            : first >= 0xc2 ? 2
                                            : 0;
  if (bytes == 0 || at + bytes > text.size()) return {};
  std::uint32_t code = first & (0x7fu >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(at + i) & 0xc0) != 0x80) return {};
    code = code << 6 | (byte(at + i) & 0x3f);
  }
  const bool is_too_long = (bytes == 3 && code < 0x800) || (bytes == 4 && code < 0x10000);
  const bool is_none = (code >= 0xd800 && code < 0xe000) || code > 0x10ffff;
  return is_too_long || is_none ? Character{} : Character{code, bytes};
}

bool commands_a_terminal(std::uint32_t code) {
  return code < 0x20 || (code >= 0x7f && code < 0xa0) || (code >= 0x2028 && code <= 0x202e) ||
         (code >= 0x2066 && code <= 0x2069);
}

std::string escaped(char c) {
  constexpr const char* hex = "0123456789abcdef";
  const auto byte = static_cast<unsigned char>(c);
  return std::string("\\x") + hex[byte >> 4] + hex[byte & 15];
}

}  // namespace

std::string without_commands(std::string_view text) {
  std::string safe;
  for (std::size_t at = 0; at < text.size();) {
    const Character character = character_at(text, at);
    const std::size_t bytes = character.bytes > 0 ? character.bytes : 1;
    if (text[at] == '\n' || text[at] == '\t' ||
        (character.bytes > 0 && !commands_a_terminal(character.code)))
      safe.append(text, at, bytes);
    else
      for (std::size_t i = at; i < at + bytes; ++i) safe += escaped(text[i]);
    at += bytes;
  }
  return safe;
}

std::string on_one_line(std::string_view text) {
  std::string line(text.substr(0, text.find_last_not_of("\r\n") + 1));
  std::ranges::replace_if(
      line, [](char c) { return c == '\n' || c == '\t'; }, ' ');
  return without_commands(line);
}

std::string with_short_lines(std::string_view text) {
  constexpr std::size_t longest = 4000;
  std::string all;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    if (line.size() <= longest)
      all += line;
    else
      all.append(line.substr(0, longest / 2))
          .append(" ... ")
          .append(line.substr(line.size() - longest / 2));
    if (line.size() < text.size()) all += '\n';
    text.remove_prefix(std::min(line.size() + 1, text.size()));
  }
  return all;
}

std::streamsize SafeOutput::Buffer::xsputn(const char* text, std::streamsize count) {
  const std::string_view given(text, static_cast<std::size_t>(count));
  const std::string safe = given == erase_line ? std::string(given) : without_commands(given);
  const auto size = static_cast<std::streamsize>(safe.size());
  return below_->sputn(safe.data(), size) == size ? count : 0;
}

int SafeOutput::Buffer::overflow(int c) {
  if (c == traits_type::eof()) return 0;
  const char letter = traits_type::to_char_type(c);
  return xsputn(&letter, 1) == 1 ? c : traits_type::eof();
}

}  // namespace previz
