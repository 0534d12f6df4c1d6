// Pictures side by side for people to look at.
#pragma once

#include <string>
#include <vector>

#include "drivers/frame.hpp"
#include "drivers/plate.hpp"
#include "tests/truth/compare.hpp"

namespace previz::truth {

struct Panel {
  std::string caption;
  Plate picture;  // 8 bit
};
// Rows of panels of one size.
Plate sheet(const std::vector<std::vector<Panel>>& rows);

// Plate, composite, the ideal composite and five times the difference of the two last (mid-gray:
// none), side by side with their names, as the display shows them.
Plate comparison_sheet(const TruthFrame& truth, const EstimatedFrame& estimate);

}  // namespace previz::truth
