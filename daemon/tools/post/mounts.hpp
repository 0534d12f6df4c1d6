// How file systems are mounted.
#pragma once

#include <filesystem>
#include <string>

namespace previz::post {

// Returns how the file system of a folder is mounted, if it is so that locks of fcntl(2) exclude
// only processes of the same machine: "nfs with local_lock=all". Empty: they reach the other
// machines, as far as the mount tells. `table` has the form of fstab(5).
std::string local_locks_of(const std::filesystem::path& folder,
                           const char* table = "/proc/self/mounts");

}  // namespace previz::post
