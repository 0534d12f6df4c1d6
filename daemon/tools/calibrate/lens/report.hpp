// Prints what every calibration reports in the same words, and writes the tables.
#pragma once

#include <filesystem>
#include <numbers>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/bundle.hpp"
#include "daemon/tools/calibrate/lens/uncertainty.hpp"
#include "daemon/tools/calibrate/lens/views.hpp"

namespace previz::calibrate {

inline constexpr double degree = std::numbers::pi / 180;

// Prints the views with their rms, what was left out, the parameters with their standard
// deviations, and how certain the projection is.
void print_fit(const Views& views, const BundleFit& fit, std::span<const char* const> names,
               std::vector<UncertainPixel> picture, std::ostream& out);

// How the comment of a calibration that was forced begins.
inline constexpr const char* not_to_be_relied_on = "UNRELIABLE";

// Throws previz::Error naming what is missing. With `force` it prints that on `out` instead, and
// returns it as a comment for the table, which is empty if nothing is missing.
std::string insist(const std::vector<std::string>& missing, bool force, std::ostream& out);

// Prints a warning on `out` for each doubt, and returns them as a comment for the table.
std::string warn(const std::vector<std::string>& doubts, std::ostream& out);

// Returns the lines as a comment of a set file, each of at most about 100 characters.
std::string as_comment(const std::string& text);

// Writes the set file's tables to `file`, or to `out` if there is none.
void write_tables(const std::string& tables, const std::optional<std::filesystem::path>& file,
                  std::ostream& out);

// Replaces a set file by `text`, keeps the old file beside it, and says so.
void write_back(const std::filesystem::path& set_file, const std::string& text, std::ostream& out);

}  // namespace previz::calibrate
