#include "daemon/core/session/summary.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_lines.hpp"
#include "daemon/core/session/session_toml.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

constexpr std::array own_names = {"session.toml", "observer.mkv",    "observer.jsonl",
                                  "light.mkv",    "light.jsonl",     "composite.mkv",
                                  "track.jsonl",  "composite.jsonl", "events.jsonl"};

// Assets are named by the SHA-256 of their content.
bool is_asset_name(const std::filesystem::path& name) {
  const std::string hash = name.stem().string();
  return hash.size() == 64 && hash.find_first_not_of("0123456789abcdef") == std::string::npos;
}

// Calls `visit` with the files that are, or stand in the place of, a session's own, by their paths
// in its folder. Throws previz::Error if a folder cannot be listed.
template <typename Visit>
void visit_own(const std::filesystem::path& directory, const std::filesystem::path& folder,
               const Visit& visit) {
  std::error_code failure;
  for (const auto& entry : std::filesystem::directory_iterator(directory / folder, failure)) {
    const std::filesystem::path name = entry.path().filename();
    const bool is_own = folder.empty() ? std::ranges::find(own_names, name) != own_names.end()
                                       : is_asset_name(name);
    if (is_own) visit(folder / name, entry);
  }
  if (failure && failure != std::errc::no_such_file_or_directory)
    throw Error((directory / folder).string() + ": cannot be listed: " + failure.message());
}

template <typename Visit>
void visit_own(const std::filesystem::path& directory, const Visit& visit) {
  visit_own(directory, {}, visit);
  if (std::filesystem::is_directory(std::filesystem::symlink_status(directory / "assets")))
    visit_own(directory, "assets", visit);
}

}  // namespace

Summary summary_of(const std::filesystem::path& directory) {
  const std::filesystem::path toml = directory / "session.toml";
  if (!std::filesystem::exists(directory)) throw Error(directory.string() + ": not found");
  std::error_code unreadable;  // reading the file gives a better error
  if (std::filesystem::symlink_status(toml, unreadable).type() ==
      std::filesystem::file_type::not_found)
    throw Error(directory.string() + ": is not a take; it holds no session.toml");
  SessionFile file = read_session_toml(toml);
  Summary summary{std::move(file.info), file.closed, file.fault, file.lost, 0, 0, 0};
  const auto observer = read_frame_lines(directory / "observer.jsonl").records;
  summary.frames = observer.size();
  summary.light_frames = read_frame_lines(directory / "light.jsonl").records.size();
  if (!observer.empty())
    summary.seconds = 1e-9 * static_cast<double>(observer.back().record.timestamp_ns -
                                                 observer.front().record.timestamp_ns);
  return summary;
}

std::vector<std::filesystem::path> own_files(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> files;
  visit_own(directory, [&](const std::filesystem::path& file, const auto& entry) {
    if (!entry.is_symlink() && entry.is_regular_file()) files.push_back(file);
  });
  std::ranges::sort(files);
  return files;
}

std::vector<std::string> strangers_in(const std::filesystem::path& directory) {
  std::vector<std::string> strangers;
  const auto look_at = [&](const std::filesystem::path& file) {
    const std::string why_not = why_not_plain(directory / file);
    if (!why_not.empty()) strangers.push_back(file.string() + ": " + why_not);
  };
  visit_own(directory, [&](const std::filesystem::path& file, const auto&) { look_at(file); });
  if (!std::filesystem::is_directory(std::filesystem::symlink_status(directory / "assets")))
    look_at("assets");
  std::ranges::sort(strangers);
  return strangers;
}

}  // namespace previz::session
