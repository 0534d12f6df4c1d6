#include "daemon/output/file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::output {

std::filesystem::path unfinished_name(const std::filesystem::path& path) {
  return std::filesystem::path(path) += ".part";
}

namespace {

void put_in_place(const std::filesystem::path& unfinished, const std::filesystem::path& path) {
  std::error_code code;
  std::filesystem::rename(unfinished, path, code);
  if (code) throw Error(path.string() + ": cannot be put in place: " + code.message());
}

}  // namespace

void finish(const std::filesystem::path& unfinished, const std::filesystem::path& path) {
  const int descriptor = ::open(unfinished.c_str(), O_RDONLY | O_CLOEXEC);
  const bool synced = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!synced)
    throw Error(unfinished.string() + ": cannot be written to disk: " + std::strerror(error));
  put_in_place(unfinished, path);
  session::sync_names(path.parent_path());
}

void write_whole(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path&)>& write, Sync sync) {
  const std::filesystem::path unfinished = unfinished_name(path);
  try {
    write(unfinished);
    sync == Sync::yes ? finish(unfinished, path) : put_in_place(unfinished, path);
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove(unfinished, ignored);
    throw;
  }
}

}  // namespace previz::output
