// The one exception type: a message that already names the file, line, key or device at fault.
// Beside it stands what spells out lists in such messages, and other exceptions' reasons.
#pragma once

#include <new>
#include <stdexcept>
#include <string>
#include <string_view>

namespace previz {

class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message) : std::runtime_error(message) {}
};

// Returns what went wrong, in words; needs no memory where that has run out.
inline const char* reason_of(const std::exception& error) {
  return dynamic_cast<const std::bad_alloc*>(&error) ? "the computer's memory is full"
                                                     : error.what();
}

// Appends an item to a list in words: "a, b, c".
inline void add_to_list(std::string& list, std::string_view item, const char* between = ", ") {
  if (!list.empty()) list += between;
  list += item;
}

}  // namespace previz
