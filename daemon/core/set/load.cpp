// Parses a set file by the table of keys: TOML goes in; typed values, or every problem, come out.
#include "daemon/core/set/load.hpp"

#include <algorithm>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/read_tables.hpp"
#include "daemon/core/set/resolve.hpp"
#include "daemon/core/set/table.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/toml_value.hpp"

namespace previz::set {
namespace {

// Returns the table that has such a key, as Homes.
std::string home_of(const std::string& key) {
  Draft scratch;
  return home_among(sections(scratch), key);
}

// Reads the overlay over what the draft has already. Its lines are counted on from those of the
// set, so that a position says which of the files it is in.
void read_over(Draft& draft, const Overlay& with, const std::string& text, Problems& problems) {
  const auto lines = static_cast<std::uint32_t>(std::ranges::count(text, '\n') + 1);
  problems.go_on_with(with.file.string(), lines);
  toml::table root = parse_toml(std::string(lines, '\n') + with.text, with.file.string(),
                                sections(draft), problems);
  constexpr std::string_view allowed[] = {"quality", "estimator", "lighting"};
  std::vector<std::string> others;
  for (const auto& [name, node] : root)
    if (std::ranges::find(allowed, name.str()) == std::end(allowed)) {
      others.emplace_back(name.str());
      problems.add(position(name.source()), others.back(),
                   "belongs in the set file; allowed here: [quality], [[quality.preview]], "
                   "[estimator] and [lighting]");
    }
  for (const std::string& name : others) root.erase(name);
  if (root["quality"]["preview"]) draft.preview_steps.clear();
  read_tables(root, sections(draft), home_of, problems);
}

}  // namespace

Set parse_set(const std::string& text, const std::filesystem::path& file, const Assets& assets,
              Origin origin, const std::optional<Overlay>& with) {
  Problems problems(file.string());
  Draft draft;
  const std::vector<Section> all = sections(draft);
  read_tables(parse_toml(text, file.string(), all, problems), all, home_of, problems);
  if (with) read_over(draft, *with, text, problems);
  auto set = resolve(std::move(draft), file, assets, origin, problems);
  problems.throw_if_any();
  return set;
}

namespace {

constexpr std::uint64_t most_bytes = 1 << 22;

}  // namespace

std::string read_set_file(const std::filesystem::path& file) {
  return session::read_file(file, {"a set file (TOML)", most_bytes});
}

Overlay read_overlay(const std::filesystem::path& file) {
  return {file, session::read_file(file, {"a file of settings (TOML)", most_bytes})};
}

Set load_set(const std::filesystem::path& file) {
  return parse_set(read_set_file(file), file);
}

std::optional<std::filesystem::path> output_folder(const std::filesystem::path& file) try {
  Problems problems(file.string());
  Draft draft;
  const std::vector<Section> all = sections(draft);
  read_tables(parse_toml(read_set_file(file), file.string(), all, problems), all, home_of,
              problems);
  return file.parent_path() / draft.set.output.directory;
} catch (const Error&) {
  return std::nullopt;
}

}  // namespace previz::set
