// What every calibration says in the same words, and where its tables go.
#pragma once

#include <filesystem>
#include <numbers>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "daemon/calibrate/bundle.hpp"
#include "daemon/calibrate/uncertainty.hpp"
#include "daemon/calibrate/views.hpp"

namespace previz::calibrate {

inline constexpr double degree = std::numbers::pi / 180;

// Views with their rms, what was left out, the parameters with their standard deviations, and how
// certain the projection is.
void print_fit(const Views& views, const BundleFit& fit, std::span<const char* const> names,
               std::vector<UncertainPixel> picture, std::ostream& out);

// Throws previz::Error naming what is missing; with `force` that is a note on `out`.
void insist(const std::vector<std::string>& missing, bool force, std::ostream& out);

// The set file's tables on `out`, and in `file` if there is one.
void write_tables(const std::string& tables, const std::optional<std::filesystem::path>& file,
                  std::ostream& out);

}  // namespace previz::calibrate
