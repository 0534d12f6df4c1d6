// Pictures side by side for people to look at.
#pragma once

#include "drivers/plate.hpp"
#include "tests/truth/compare.hpp"

namespace previz::truth {

// Plate, composite, the ideal composite and five times the difference of the two last (mid-gray:
// none), side by side with their names, as the display shows them.
Plate comparison_sheet(const TruthFrame& truth, const EstimatedFrame& estimate);

}  // namespace previz::truth
