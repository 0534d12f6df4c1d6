// The one exception type: a message that already names the file, line, key or device at fault.
#pragma once

#include <stdexcept>
#include <string>

namespace previz {

class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace previz
