// Reads a set file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/set/origin.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::set {

// Settings that replace those of a set: a file with nothing but [quality], [[quality.preview]],
// [estimator] and [lighting], as `previz trade` writes it and --with takes it.
struct Overlay {
  std::filesystem::path file;
  std::string text;
};
// Reads the file; throws previz::Error that names it if it cannot be read.
Overlay read_overlay(const std::filesystem::path& file);

// Parses TOML text. `file` names it in errors, and its folder is what relative paths are relative
// to; `assets` maps paths as the set writes them to paths that stand in for them (a session's
// assets, relative to that folder too). The files of objects and the environment must exist; a
// replay device's session and the output directory need not. Tag and camera poses come out exactly
// rigid. Throws previz::Error whose message holds every problem found, one a line, in the order of
// the file's lines: file:line:column: key: what is wrong; what is allowed. Text that is not TOML at
// all is the only problem then, reported without a key. What `with` has replaces what the set has,
// key by key, but all [[quality.preview]] together; its problems name its own file and lines.
Set parse_set(const std::string& text, const std::filesystem::path& file,
              const std::vector<std::pair<std::string, std::filesystem::path>>& assets = {},
              Origin origin = Origin::crew, const std::optional<Overlay>& with = {});
// Reads and parses a file as parse_set() does; throws previz::Error that names it if it cannot be
// read.
Set load_set(const std::filesystem::path& file);

// Returns the folder that the file's [output] names, whatever else is wrong in the file; nothing if
// it cannot be read.
std::optional<std::filesystem::path> output_folder(const std::filesystem::path& file);

}  // namespace previz::set
