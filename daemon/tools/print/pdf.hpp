// Writes sheets as PDF, at true size.
#pragma once

#include <string>
#include <vector>

#include "daemon/tools/print/sheets.hpp"

namespace previz::print {

// Returns the file's content. Each sheet has crop marks around what is cut out, and below it a
// ruler of 100 mm, by which the printer's scale is checked, and the sheet's title. Throws
// previz::Error if cairo cannot write it.
std::string pdf_of(const std::vector<Drawing>& drawings, const std::vector<Sheet>& sheets,
                   const std::string& title);

inline constexpr double ruler_mm = 100;

}  // namespace previz::print
