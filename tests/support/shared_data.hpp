// Test data that is too large, or not free, to be in the repository.
#pragma once

#include "tests/support/test.hpp"

namespace previz::test {

// A file or folder of that data: PREVIZ_SHARED of the environment names the folder that it is in;
// without that it is sought in the folder "shared" beside the project's own.
inline std::filesystem::path shared_data(const std::filesystem::path& name) {
  const char* folder = std::getenv("PREVIZ_SHARED");
  return (folder ? std::filesystem::path(folder)
                 : std::filesystem::path(PREVIZ_SOURCE_DIR).parent_path() / "shared") /
         name;
}

}  // namespace previz::test

// Skips the test case that it stands in where a file or folder is missing.
#define PREVIZ_NEEDS(path)            \
  if (!std::filesystem::exists(path)) \
  GTEST_SKIP() << (path) << " is not there; PREVIZ_SHARED names the folder of such data"
