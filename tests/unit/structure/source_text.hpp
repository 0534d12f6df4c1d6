// The project's source folder, and the text of its files.
#pragma once

#include "tests/support/test.hpp"

namespace previz::test {

inline const std::filesystem::path source = PREVIZ_SOURCE_DIR;

inline std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace previz::test
