// How a machine is known to be alive where the file system has no locks that other machines see.
#pragma once

#include <chrono>
#include <cstdint>
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

// Two machines that take something at the same moment, where no lock tells, have both told so by
// then.
inline constexpr std::chrono::seconds for_another_to_tell(2);

// Returns the time that the disk of a folder gives to a new file, in seconds since 1970. Throws
// previz::Error where none can be written.
std::int64_t time_of_disk_s(const std::filesystem::path& folder);

// Returns whether the file is not older than it can be, as seen from another machine, if somebody
// renews it: three minutes. Nor is it younger than now by more than that: clocks are not so wrong.
bool has_signs_of_life(const std::filesystem::path& file);

}  // namespace previz::farm
