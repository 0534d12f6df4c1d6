#include "daemon/output/take_folders.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <set>
#include <system_error>
#include <utility>

#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

namespace previz::output {
namespace {

std::filesystem::path wish_in(const std::filesystem::path& folder) {
  return folder / ".recording";
}

std::string megabytes(std::uint64_t bytes) {
  return std::to_string(bytes / 1'000'000) + " MB";
}

// Returns the folder, or where it will be made the folder above it.
std::filesystem::path existing(const std::filesystem::path& folder) {
  std::filesystem::path above = std::filesystem::absolute(folder);
  while (!std::filesystem::exists(above) && above.has_relative_path()) above = above.parent_path();
  return above;
}

std::optional<dev_t> disk_of(const std::filesystem::path& folder) {
  struct stat status {};
  if (::stat(existing(folder).c_str(), &status) != 0) return std::nullopt;
  return status.st_dev;
}

std::uint64_t free_on_disk_of(const std::filesystem::path& folder,
                              const TakeFolders::FreeBytes& free_bytes) {
  return free_bytes ? free_bytes(folder) : std::filesystem::space(existing(folder)).available;
}

}  // namespace

bool are_on_one_disk(const std::filesystem::path& a, const std::filesystem::path& b) {
  const std::optional<dev_t> of_a = disk_of(a);
  return of_a && of_a == disk_of(b);
}

TakeFolders::TakeFolders(std::vector<std::filesystem::path> folders, std::uint64_t reserve_bytes,
                         FreeBytes free_bytes)
    : folders_(std::move(folders)),
      reserve_bytes_(reserve_bytes),
      free_bytes_(std::move(free_bytes)),
      given_up_(folders_.size()) {}

std::size_t TakeFolders::choose() {
  std::string why_none;
  for (std::size_t i = 0; i < folders_.size(); ++i) {
    std::string why = given_up_[i];
    try {
      if (why.empty()) session::make_folders(folders_[i]);
      if (why.empty()) why = why_full(i);
      if (why.empty()) return i;
    } catch (const std::exception& error) {
      why = error.what();
    }
    why_none += (why_none.empty() ? "" : "; ") + why;
  }
  throw Error(why_none);
}

std::string TakeFolders::why_full(std::size_t folder) const {
  const std::uint64_t free = free_on_disk_of(folders_[folder], free_bytes_);
  if (free >= reserve_bytes_) return {};
  return folders_[folder].string() + ": the disk is almost full, " + megabytes(free) +
         " are left and " + megabytes(reserve_bytes_) + " are kept free (recording.reserve_mb)";
}

bool TakeFolders::give_up(std::size_t folder, const std::string& why) {
  given_up_[folder] = why;
  return std::ranges::count(given_up_, std::string()) > 0;
}

void TakeFolders::forgive_all() {
  std::ranges::fill(given_up_, std::string());
}

std::function<bool(std::uint64_t)> TakeFolders::room_of(std::size_t folder) const {
  return [folder = folders_[folder], kept = reserve_bytes_, ask = free_bytes_](
             std::uint64_t bytes) { return free_on_disk_of(folder, ask) >= kept + bytes; };
}

std::optional<double> TakeFolders::measure_speed() {
  using Clock = std::chrono::steady_clock;
  constexpr std::size_t piece = 4'000'000, most = 64'000'000;
  constexpr std::chrono::milliseconds long_enough{500};
  const std::filesystem::path folder = folders_[choose()];
  if (free_on_disk_of(folder, free_bytes_) < reserve_bytes_ + 2 * most) return std::nullopt;
  std::string bytes(piece, '\0');  // noise, which no disk can make smaller
  std::minstd_rand random(1);
  for (char& byte : bytes) byte = static_cast<char>(random());
  const std::filesystem::path file = folder / ".speed";
  std::size_t written = 0;
  const Clock::time_point begin = Clock::now();
  {
    const session::OpenFile probe(file, O_WRONLY | O_CREAT | O_TRUNC);
    std::filesystem::remove(file);  // it goes when it is closed, or the process ends
    for (; written < most && Clock::now() - begin < long_enough; written += piece) {
      probe.append(bytes);
      probe.sync();
    }
  }
  return static_cast<double>(written) / std::chrono::duration<double>(Clock::now() - begin).count();
}

std::optional<std::uint64_t> TakeFolders::free_bytes() const {
  std::optional<std::uint64_t> sum;
  std::set<dev_t> counted;
  for (std::size_t i = 0; i < folders_.size(); ++i) {
    const std::filesystem::path& folder = folders_[i];
    try {
      if (!given_up_[i].empty() || ::access(existing(folder).c_str(), W_OK) != 0) continue;
      const std::uint64_t free = free_on_disk_of(folder, free_bytes_);
      if (!counted.insert(disk_of(folder).value_or(0)).second) continue;
      sum = sum.value_or(0) + free - std::min(free, reserve_bytes_);
    } catch (const std::filesystem::filesystem_error&) {
      // This disk cannot say.
    }
  }
  return sum;
}

void TakeFolders::keep_wish(const std::filesystem::path& take) {
  session::replace_file(wish_in(take.parent_path()), take.filename().string() + "\n");
}

void TakeFolders::drop_wish() const {
  std::string faults;
  const auto add_fault = [&](const std::string& fault) {
    faults += (faults.empty() ? "" : "; ") + fault;
  };
  for (const std::filesystem::path& folder : folders_) {
    std::error_code failure;
    const bool was_there = std::filesystem::remove(wish_in(folder), failure);
    if (failure) add_fault(wish_in(folder).string() + ": cannot be removed: " + failure.message());
    try {
      if (was_there) session::sync_names(folder);
    } catch (const Error& error) {
      add_fault(error.what());
    }
  }
  if (!faults.empty()) throw Error(faults);
}

std::optional<std::string> TakeFolders::kept_wish() const {
  std::optional<std::string> newest;
  std::filesystem::file_time_type newest_time{};
  for (const std::filesystem::path& folder : folders_) {
    std::error_code none;
    const auto time = std::filesystem::last_write_time(wish_in(folder), none);
    if (none || (newest && time < newest_time)) continue;
    try {
      newest = session::read_file(wish_in(folder));
    } catch (const Error&) {
      continue;
    }
    while (!newest->empty() && newest->back() == '\n') newest->pop_back();
    newest_time = time;
  }
  return newest;
}

}  // namespace previz::output
