#include "daemon/core/set/resolve.hpp"

#include <algorithm>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/resolving.hpp"

namespace previz::set {

namespace fs = std::filesystem;

const Given& Resolving::given(const std::string& table) {
  auto& given = draft.given[table];
  given.path = table;
  return given;
}

void Resolving::problem(const Given& table, const std::string& key, const std::string& what) {
  problems.add(table.where(key), table.path + '.' + key, what);
}

void Resolving::exclude(const Given& table, std::initializer_list<const char*> keys,
                        const std::string& reason) {
  for (const auto* key : keys)
    if (table.has(key)) problem(table, key, reason);
}

void Resolving::carried(const Given& table, const std::string& by) {
  const auto& carriers = set.tracking.carriers;
  if (by.empty() || std::ranges::find(carriers, by, &Carrier::name) != carriers.end()) return;
  std::vector<std::string> known;
  for (const Carrier& carrier : carriers) known.push_back(carrier.name);
  const std::string near = nearest(by, known);
  problem(table, "carrier",
          "no tag is on a carrier " + codec::quote(by) +
              (near.empty() ? "; allowed: the carrier of a [[tag]]"
                            : "; did you mean " + codec::quote(near) + "?"));
}

fs::path Resolving::located(const fs::path& as_written) const {
  return (folder / as_written).lexically_normal();
}

fs::path Resolving::folder_at(const char* table, const char* key, const fs::path& as_written) {
  const fs::path place = located(as_written);
  const std::string path = place.string(), below = path + '/';
  if (below.starts_with("/proc/") || below.starts_with("/sys/"))
    problem(given(table), key, path + " is not on a disk; allowed: a folder on a disk");
  return place.has_filename() || place == place.root_path() ? place : place.parent_path();
}

fs::path Resolving::existing(const Given& table, const std::string& key,
                             const fs::path& as_written) {
  if (!table.good(key)) return {};
  auto path = located(as_written);
  bool may_be_elsewhere = origin == Origin::crew || origin == Origin::trusted_session;
  for (const auto& [name, stand_in] : assets) {
    if (name != as_written.string()) continue;
    path = located(stand_in);
    may_be_elsewhere |= origin == Origin::job;
  }
  const std::string whole = origin == Origin::job ? "job" : "take";
  std::error_code error;
  if (!may_be_elsewhere && !session::lies_within(folder, path))
    problem(table, key,
            "lies outside the " + whole + "'s folder, and is not read; allowed: files of the " +
                whole + ", or --any-paths for a " + whole + " that you trust");
  else if (!fs::is_regular_file(path, error))
    problem(table, key,
            "no such file: " + path.string() +
                "; allowed: a file that exists, its path relative to the folder of this file");
  return path;
}

namespace {

void resolve_recording(Resolving& work) {
  work.set.recording.directory =
      work.folder_at("recording", "directory", work.set.recording.directory);
  auto& second = work.set.recording.second_directory;
  if (second) second = work.folder_at("recording", "second_directory", *second);
  if (second == work.set.recording.directory)
    work.problem(work.given("recording"), "second_directory",
                 "is the folder of recording.directory; allowed: a folder on another disk");
}

}  // namespace

Set resolve(Draft draft, const fs::path& file, const Assets& assets, Origin origin,
            Problems& problems) {
  Set& set = draft.set;
  set.file = file;
  if (set.name.empty()) set.name = set.file.stem().string();
  Resolving work{draft, set, file.parent_path(), assets, origin, problems};
  resolve_cameras(work);
  resolve_tags(work);
  resolve_objects(work);
  resolve_lights(work);
  for (const auto& [table, step] : draft.preview_steps) set.quality.steps.push_back(step);
  resolve_controls(work);
  resolve_recording(work);
  set.output.directory = work.folder_at("output", "directory", set.output.directory);
  return std::move(set);
}

}  // namespace previz::set
