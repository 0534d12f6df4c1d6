// Finds out, before a task begins, whether the machine that it was given can do it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "daemon/core/render/device/gpu.hpp"
#include "daemon/tools/farm/folder.hpp"
#include "daemon/tools/farm/job.hpp"

namespace previz::farm {

// What a task asks its machine. A test puts another one in its place.
struct Machine {
  std::string host;
  std::string software;                 // of this previzd
  std::function<std::int64_t()> now_s;  // seconds since 1970
  // Returns the bytes that may still be written beside the file; throws previz::Error.
  std::function<std::uint64_t(const std::filesystem::path& folder)> free_bytes;
  std::function<std::shared_ptr<render::Device>(const render::DeviceOptions&)> open_device;
};

Machine this_machine();

// Returns what keeps this machine from a take of the job, as one sentence that says what to do;
// empty: nothing. Looked at are the version, the take and the set, the room on the disks of the job
// and of the pictures, and the clock, which must be within a minute of that of the job's disk.
std::string why_not_here(const JobFolder& folder, const Job& job, const JobTake& take,
                         const Machine& machine);

// Opens the device that the job wants for a take; throws previz::Error that says what is missing
// here.
std::shared_ptr<render::Device> open_wanted_device(const Job& job, const JobTake& take,
                                                   const Machine& machine);

}  // namespace previz::farm
