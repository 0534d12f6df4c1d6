#include "daemon/output/recording_wish.hpp"

#include <system_error>

#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::output {
namespace {

std::filesystem::path file_in(const std::filesystem::path& takes) {
  return takes / ".recording";
}

}  // namespace

void keep_wish(const std::filesystem::path& takes, const std::string& take) {
  session::replace_file(file_in(takes), take + "\n");
}

void drop_wish(const std::filesystem::path& takes) {
  std::error_code failure;
  const bool was_there = std::filesystem::remove(file_in(takes), failure);
  if (failure) throw Error(file_in(takes).string() + ": cannot be removed: " + failure.message());
  if (was_there) session::sync_names(takes);
}

std::optional<std::string> kept_wish(const std::filesystem::path& takes) {
  if (!std::filesystem::exists(file_in(takes))) return std::nullopt;
  std::string take = session::read_file(file_in(takes));
  while (!take.empty() && take.back() == '\n') take.pop_back();
  return take;
}

}  // namespace previz::output
