// Undoes a camera's response.
#pragma once

#include "drivers/calibration.hpp"

namespace previz {

// Returns the linear signal 0..1 that a value, clipped to 0..1, stands for. A table is linear
// between its entries, of which it has two at least.
double inverse_response(const ResponseCurve& curve, double value);

}  // namespace previz
