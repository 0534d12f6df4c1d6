#include "daemon/core/live/graphics.hpp"

#include <sys/resource.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/error.hpp"

namespace previz::live {
namespace {

std::optional<std::filesystem::path> memory_file() {
  const char* folder = std::getenv("STATE_DIRECTORY");
  if (!folder || *folder == '\0') return std::nullopt;
  return std::filesystem::path(folder) / "graphics-device";
}

// Returns the GPU that the rig had; empty if none is known. A file that cannot be read is none.
std::string remembered_gpu(const std::filesystem::path& memory) {
  try {
    const std::string name = session::read_file(memory, {"the name of a card", 1 << 12});
    return name.substr(0, name.find('\n'));
  } catch (const Error&) {
    return {};
  }
}

void remember(const std::filesystem::path& memory, const std::string& gpu,
              report::Reports& reports) {
  if (remembered_gpu(memory) == gpu) return;
  try {
    session::replace_file(memory, gpu + "\n");
  } catch (const Error& error) {
    reports(report::once({report::Severity::warning, "", error.what()}));
  }
}

// Mesa's driver for the processor draws in threads of these names.
constexpr std::string_view drawing_threads = "llvmpipe-";
constexpr int drawing_niceness = 10;  // about a tenth of the time, where two want a core

}  // namespace

void let_recording_first() {
  std::error_code unreadable;
  for (std::filesystem::directory_iterator task("/proc/self/task", unreadable), end;
       !unreadable && task != end; task.increment(unreadable)) {
    std::ifstream file(task->path() / "comm");
    std::string name;
    std::getline(file, name);
    if (!name.starts_with(drawing_threads)) continue;
    const auto thread = static_cast<id_t>(std::stoul(task->path().filename().string()));
    ::setpriority(PRIO_PROCESS, thread,
                  drawing_niceness);  // of this thread only; may only be refused
  }
}

std::shared_ptr<render::Device> open_graphics(const render::DeviceOptions& options,
                                              bool cpu_instead, report::Reports& reports) {
  const std::optional<std::filesystem::path> memory =
      options.name.empty() ? memory_file() : std::nullopt;
  if (!memory) return render::open_device(options);
  const std::string had = remembered_gpu(*memory);
  std::shared_ptr<render::Device> device =
      had.empty() ? render::awaited_device(options) : render::awaited_gpu(options);
  try {
    render::reopen_device(*device, cpu_instead);
    if (render::is_gpu(*device)) remember(*memory, render::device_name(*device), reports);
  } catch (const Error& error) {
    const std::string what =
        had.empty() ? "no graphics card; takes can be recorded; waiting for one. "
                    : "the rig's graphics card " + had +
                          " is missing; waiting for it. If it is gone for good, delete " +
                          memory->string() + ". ";
    reports({report::Severity::error, "", what + error.what()});
  }
  return device;
}

std::string device_words(const render::Device& device) {
  const std::string name = render::drawing_device(device);
  return name.empty() ? "no graphics card yet" : name;
}

}  // namespace previz::live
