#include "daemon/tools/post/take_copy.hpp"

#include <fcntl.h>

#include <map>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/summary.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

namespace fs = std::filesystem;

using Checksums = std::map<std::string, std::string>;  // of files, by their paths

constexpr std::size_t hash_digits = 64, longest_name = 8192;

// A name may have any byte. As sha256sum(1) does, a line whose name has a backslash or the end of a
// line begins with a backslash, and these two are escaped in it.
std::string line_of(const std::string& file, const std::string& hash) {
  std::string name;
  for (const char c : file) {
    if (c == '\\') name += "\\\\";
    if (c == '\n') name += "\\n";
    if (c != '\\' && c != '\n') name += c;
  }
  return (name == file ? "" : "\\") + hash + "  " + name + "\n";
}

std::string unescaped(const std::string& name) {
  std::string file;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool is_escaped = name[i] == '\\' && i + 1 < name.size();
    if (is_escaped) ++i;
    file += is_escaped && name[i] == 'n' ? '\n' : name[i];
  }
  return file;
}

std::string to_text(const Checksums& sums) {
  std::string text;
  for (const auto& [file, hash] : sums) text += line_of(file, hash);
  return text;
}

Checksums read_checksums(const fs::path& file) {
  Checksums sums;
  session::PlainLines lines(file);
  int number = 0;
  for (std::string line; lines.next(line);) {
    ++number;
    const bool is_escaped = line.starts_with('\\');
    if (is_escaped) line.erase(0, 1);
    const std::size_t path = hash_digits + 2;
    if (line.size() <= path || line.size() > path + longest_name)
      throw Error(file.string() + ":" + std::to_string(number) +
                  ": is not a checksum and a file; copy the take again");
    const std::string name = line.substr(path);
    sums[is_escaped ? unescaped(name) : name] = line.substr(0, hash_digits);
  }
  return sums;
}

// Copies a file and waits until it is on the medium, from where it is read again afterwards.
void copy_synced(const fs::path& from, const fs::path& to, const std::stop_token& stop) {
  const session::OpenFile copy(to, O_WRONLY | O_CREAT | O_EXCL);
  session::read_blocks(
      session::open_plain_file(from), [&] { return stop.stop_requested(); },
      [&](std::string_view block) { copy.append(block); });
  copy.sync();
  ::posix_fadvise(copy.get(), 0, 0, POSIX_FADV_DONTNEED);
}

bool is_same_copy(const output::ListedTake& take, const fs::path& copy) {
  const fs::path sums = copy / checksums_name;
  if (!fs::is_regular_file(fs::symlink_status(sums))) return false;
  const Checksums known = read_checksums(sums);
  const std::vector<fs::path> files = session::own_files(take.directory);
  if (known.size() != files.size()) return false;
  for (const fs::path& file : files) {
    std::error_code gone;
    if (!known.contains(file.string()) ||
        fs::file_size(copy / file, gone) != fs::file_size(take.directory / file))
      return false;
  }
  return known.at("session.toml") == session::sha256_of(take.directory / "session.toml");
}

void check_room(const output::ListedTake& take, const fs::path& folder) {
  std::error_code unknown;
  const fs::space_info space = fs::space(folder, unknown);
  if (!unknown && space.available < take.bytes)
    throw Error(folder.string() + ": the disk lacks " +
                std::to_string((take.bytes - space.available) / 1000 + 1) +
                " kB: it has room for " + std::to_string(space.available / 1000) + " kB, and " +
                take.directory.filename().string() + " has " +
                std::to_string(take.bytes / 1000 + 1) + " kB");
}

}  // namespace

bool copy_take(const output::ListedTake& take, const fs::path& copy, const std::stop_token& stop) {
  const fs::path folder = fs::absolute(copy).parent_path();
  if (session::lies_within(take.directory, copy))
    throw Error(copy.string() + ": is inside the take; choose another folder");
  if (fs::exists(copy)) {
    if (is_same_copy(take, copy)) return false;
    throw Error(copy.string() +
                ": already exists and is not a current copy of this take; copy to another "
                "folder, or remove it");
  }
  check_room(take, folder);
  if (const auto strangers = session::strangers_in(take.directory); !strangers.empty())
    throw Error((take.directory / strangers.front()).string() +
                "; without it the copy is not whole");
  session::remove_dead_drafts(folder);
  session::DraftFolder draft(copy);
  Checksums sums;
  for (const fs::path& file : session::own_files(take.directory)) {
    const fs::path from = take.directory / file, to = draft.path() / file;
    fs::create_directories(to.parent_path());
    copy_synced(from, to, stop);
    const std::string hash = session::sha256_of(from, stop);
    if (session::sha256_of(to, stop) != hash)
      throw Error(copy.string() + ": " + file.string() +
                  " does not read back as written; the disk or its cable is failing; no "
                  "copy was made");
    sums[file.string()] = hash;
  }
  session::replace_file(draft.path() / checksums_name, to_text(sums));
  if (fs::exists(draft.path() / "assets")) session::sync_names(draft.path() / "assets");
  draft.put();
  return true;
}

std::vector<std::string> checksum_faults(const fs::path& copy, const std::stop_token& stop) {
  std::vector<std::string> faults;
  // What else may be there is named as it is read.
  if (!fs::exists(fs::symlink_status(copy / checksums_name))) return faults;
  for (const auto& [file, hash] : read_checksums(copy / checksums_name)) {
    const fs::path path = copy / file;
    if (!session::lies_within(copy, path))
      faults.push_back(std::string(checksums_name) + ": " + file + " lies outside the take");
    else if (!fs::is_regular_file(path))
      faults.push_back(file + ": is missing; copy the take again");
    else if (session::sha256_of(path, stop) != hash)
      faults.push_back(file + ": was changed since it was copied; copy the take again");
  }
  return faults;
}

void write_checksum(const fs::path& copy, const std::string& file) {
  Checksums sums = read_checksums(copy / checksums_name);
  sums[file] = session::sha256_of(copy / file);
  session::replace_file(copy / checksums_name, to_text(sums));
}

}  // namespace previz::post
