// Looks whether what a program has said on its standard output has arrived.
#pragma once

#include <cerrno>
#include <cstring>
#include <iostream>
#include <string>

namespace previz {

// Returns the exit status of a program that ends with `status`: 1 where its standard output could
// not be written, as on a full disk, which a line on standard error then says.
inline int finished_output(const std::string& program, int status) {
  errno = 0;
  if (std::cout.flush()) return status;
  const std::string why = errno == 0 ? "" : std::string(": ") + std::strerror(errno);
  std::cerr << program << ": standard output cannot be written" << why
            << "; what was to be read there is not complete" << std::endl;
  return status == 0 ? 1 : status;
}

}  // namespace previz
