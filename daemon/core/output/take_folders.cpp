#include "daemon/core/output/take_folders.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include "daemon/core/output/take_writer.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/session.hpp"
#include "drivers/error.hpp"

namespace previz::output {
namespace {

std::filesystem::path wish_in(const std::filesystem::path& folder) {
  return folder / ".recording";
}

// The names of takes, a line each: the highest of each slate that any folder has.
std::filesystem::path names_in(const std::filesystem::path& folder) {
  return folder / ".highest_takes";
}

// Returns their lines. A file that is none of ours, or cannot be read, says nothing; `note` says
// so.
std::string kept_names(const std::filesystem::path& folder, const TakeFolders::Note& note) {
  constexpr session::FileKind kind{"a list of takes", 1 << 16};
  std::error_code none;
  if (!std::filesystem::exists(names_in(folder), none)) return {};
  try {
    return session::read_plain_file(names_in(folder), kind);
  } catch (const Error& error) {
    if (note) note(std::string(error.what()) + "; what it says of other takes is not known");
    return {};
  }
}

std::string megabytes(std::uint64_t bytes) {
  return std::to_string(bytes / 1'000'000) + " MB";
}

}  // namespace

std::filesystem::path existing_part(const std::filesystem::path& folder) {
  std::error_code unknown;
  std::filesystem::path there = std::filesystem::absolute(folder);
  while (!std::filesystem::exists(there, unknown) && there.has_relative_path())
    there = there.parent_path();
  return there;
}

std::optional<dev_t> disk_of(const std::filesystem::path& folder) {
  struct stat status {};
  if (::stat(existing_part(folder).c_str(), &status) != 0) return std::nullopt;
  return status.st_dev;
}

std::uint64_t free_on_disk_of(const std::filesystem::path& folder,
                              const TakeFolders::FreeBytes& free_bytes) {
  return free_bytes ? free_bytes(folder) : std::filesystem::space(existing_part(folder)).available;
}

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

std::size_t TakeFolders::choose(const std::function<std::string(std::size_t)>& why_not) {
  std::string why_none;
  for (std::size_t i = 0; i < folders_.size(); ++i) {
    std::string why = given_up_[i];
    try {
      if (why.empty()) session::make_folders(folders_[i]);
      if (why.empty() && why_not) why = why_not(i);
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
         " are free, " + megabytes(reserve_bytes_) + " are reserved (recording.reserve_mb)";
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
  std::size_t written = 0;
  const Clock::time_point begin = Clock::now();
  {
    const session::Draft probe(folder / "speed");  // which goes at the end
    for (; written < most && Clock::now() - begin < long_enough; written += piece) {
      probe.file().append(bytes);
      probe.file().sync();
    }
  }
  return static_cast<double>(written) / std::chrono::duration<double>(Clock::now() - begin).count();
}

std::optional<double> TakeFolders::measure_frame_rate(const std::vector<FramePtr>& frames,
                                                      session::VideoCodec codec) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::seconds long_enough{1}, at_the_end{1000};
  const std::filesystem::path folder = folders_[choose()];
  std::uint64_t bytes = 0;
  for (const FramePtr& frame : frames) bytes += frame->bytes.size();
  if (free_on_disk_of(folder, free_bytes_) < reserve_bytes_ + 2 * bytes) return std::nullopt;
  const session::DraftFolder draft(folder / "speed");  // which goes at the end
  std::size_t written = 0;
  session::SessionWriter trial(draft.path(), {}, at_the_end, codec);
  const Clock::time_point begin = Clock::now();
  for (; written < frames.size() && Clock::now() - begin < long_enough; ++written)
    trial.write(*frames[written]);
  trial.close();
  return static_cast<double>(written) / std::chrono::duration<double>(Clock::now() - begin).count();
}

std::optional<std::uint64_t> TakeFolders::free_bytes(const std::vector<FolderSeen>& seen) const {
  std::optional<std::uint64_t> sum;
  std::set<dev_t> counted;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!given_up_[i].empty() || !seen[i].why_not.empty() || !seen[i].free_bytes) continue;
    if (!counted.insert(seen[i].disk.value_or(0)).second) continue;
    const std::uint64_t free = *seen[i].free_bytes;
    sum = sum.value_or(0) + free - std::min(free, reserve_bytes_);
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

std::optional<KeptWish> TakeFolders::kept_wish(const Note& note) const {
  constexpr session::FileKind kind{"the name of a take", 1 << 12};
  std::optional<KeptWish> newest;
  for (const std::filesystem::path& folder : folders_) {
    std::error_code none;
    const auto time = std::filesystem::last_write_time(wish_in(folder), none);
    if (none || (newest && time < newest->time)) continue;
    try {
      const std::string text = session::read_plain_file(wish_in(folder), kind);
      newest = KeptWish{text.substr(0, text.find_last_not_of('\n') + 1), time};
    } catch (const Error& error) {
      if (note)
        note(std::string(error.what()) + "; whether a take was being recorded is not known");
    }
  }
  return newest;
}

void TakeFolders::keep_number(const std::filesystem::path& folder, const std::string& slate,
                              int number) {
  std::istringstream before(kept_names(folder, {}));
  std::string names = take_name(slate, number) + "\n";
  for (std::string name; std::getline(before, name);) {
    const std::optional<int> known = take_number(name, slate);
    if (known && *known > number) return;
    if (!known) names += name + "\n";
  }
  session::replace_file(names_in(folder), names);
}

int TakeFolders::kept_number(const std::string& slate, const Note& note) const {
  int highest = 0;
  for (const std::filesystem::path& folder : folders_) {
    std::istringstream names(kept_names(folder, note));
    for (std::string name; std::getline(names, name);)
      highest = std::max(highest, take_number(name, slate).value_or(0));
  }
  return highest;
}

}  // namespace previz::output
