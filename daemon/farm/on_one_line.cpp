#include "daemon/farm/on_one_line.hpp"

#include <cstddef>
#include <cstdint>

namespace previz::farm {
namespace {

struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  // 0: what stands there is not UTF-8
};

// Decodes the character that begins at `at` (RFC 3629).
Character character_at(const std::string& text, std::size_t at) {
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

std::string on_one_line(const std::string& text) {
  std::size_t end = text.size();
  while (end > 0 && (text[end - 1] == '\n' || text[end - 1] == '\r')) --end;
  std::string line;
  for (std::size_t at = 0; at < end;) {
    const Character character = character_at(text, at);
    const std::size_t bytes = character.bytes > 0 ? character.bytes : 1;
    if (text[at] == '\n' || text[at] == '\t')
      line += ' ';
    else if (character.bytes > 0 && !commands_a_terminal(character.code))
      line.append(text, at, bytes);
    else
      for (std::size_t i = at; i < at + bytes; ++i) line += escaped(text[i]);
    at += bytes;
  }
  return line;
}

}  // namespace previz::farm
