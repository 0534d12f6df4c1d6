#include "daemon/tools/farm/machine.hpp"

#include <cstdlib>
#include <ctime>

#include "daemon/tools/post/folder_locks.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

// Clocks that anybody sets are closer, and a larger difference would mix up the order of what
// happened.
constexpr std::int64_t most_clock_difference_s = 60;

bool can_be_seen(const std::filesystem::path& file) {
  std::error_code unknown;
  return std::filesystem::exists(file, unknown);
}

// Returns the nearest folder above that is there.
std::filesystem::path folder_above(std::filesystem::path path) {
  while (!can_be_seen(path) && path.has_relative_path()) path = path.parent_path();
  return path;
}

std::string megabytes(std::uint64_t bytes) {
  return std::to_string((bytes + 999'999) / 1'000'000) + " MB";
}

std::string why_no_room(const std::filesystem::path& path, std::uint64_t needed,
                        const Machine& machine) {
  const std::filesystem::path folder = folder_above(path);
  const std::uint64_t free = machine.free_bytes(folder);
  if (free >= needed) return "";
  return folder.string() + ": " + megabytes(free) + " are free, and a frame may need " +
         megabytes(needed) + "; make room, then call `previz farm retry`";
}

std::string why_wrong_clock(const Machine& machine, const JobFolder& folder) {
  const std::int64_t behind = post::time_of_disk_s(folder.place("state")) - machine.now_s();
  if (std::abs(behind) <= most_clock_difference_s) return "";
  return "the clock here is " + std::to_string(std::abs(behind)) + " s " +
         (behind > 0 ? "behind" : "ahead of") + " that of the job's disk; set it (timedatectl)";
}

}  // namespace

Machine this_machine() {
  Machine machine;
  machine.host = post::host_name();
  machine.software = "previzd " PREVIZ_VERSION;
  machine.now_s = [] { return static_cast<std::int64_t>(std::time(nullptr)); };
  machine.free_bytes = [](const std::filesystem::path& folder) {
    std::error_code code;
    const std::filesystem::space_info space = std::filesystem::space(folder, code);
    if (code) throw Error(folder.string() + ": " + code.message());
    return static_cast<std::uint64_t>(space.available);
  };
  machine.open_device = [](const render::DeviceOptions& options) {
    return render::open_device(options);
  };
  return machine;
}

std::string why_not_here(const JobFolder& folder, const Job& job, const JobTake& take,
                         const Machine& machine) {
  if (machine.software != job.software)
    return machine.software + " is installed here, and the job was made with " + job.software +
           ", whose pictures may differ; install that one";
  if (!can_be_seen(take.session / "session.toml"))
    return take.session.string() +
           ": the take is not found; mount its disk at the same place as where the job was made";
  if (!job.set_file.empty() && !can_be_seen(folder.place(job.set_file)))
    return folder.place(job.set_file).string() + ": not found; make the job again";
  try {
    if (std::string why = why_wrong_clock(machine, folder); !why.empty()) return why;
    for (const std::filesystem::path& place : {folder.path(), take.pictures})
      if (std::string why = why_no_room(place, take.frame_bytes, machine); !why.empty()) return why;
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

std::shared_ptr<render::Device> open_wanted_device(const Job& job, const JobTake& take,
                                                   const Machine& machine) {
  std::shared_ptr<render::Device> device =
      machine.open_device(render::options_for(job.render.device, take.hardware_rays));
  if (!job.any_device && render::is_gpu(*device) != job.on_gpu)
    throw Error(render::device_name(*device) + ": the job is rendered on " +
                (job.on_gpu ? "graphics cards, and there is none here that Vulkan can use"
                            : "processors, and this is a graphics card") +
                ": their pictures differ in the last bits. Take the machine out of the partition, "
                "or make the job with --any-device");
  return device;
}

}  // namespace previz::farm
