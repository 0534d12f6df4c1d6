// How a machine is known to be alive where the file system has no locks that other machines see.
#pragma once

#include <chrono>
#include <filesystem>
#include <thread>

namespace previz::farm {

// Renews the time of a file, as long as it lives.
class SignsOfLife {
 public:
  explicit SignsOfLife(const std::filesystem::path& file,
                       std::chrono::milliseconds between = std::chrono::seconds(20));

 private:
  std::jthread thread_;
};

// Returns whether the file is not older than it can be, as seen from another machine, if somebody
// renews it: three minutes. Nor is it younger than now by more than that: clocks are not so wrong.
bool has_signs_of_life(const std::filesystem::path& file);

}  // namespace previz::farm
